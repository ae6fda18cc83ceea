"""The compiled inner loops of the searches (numba)."""

from llm_astar_planner.search.kernel_cache import prepare_cache

prepare_cache(__file__)
