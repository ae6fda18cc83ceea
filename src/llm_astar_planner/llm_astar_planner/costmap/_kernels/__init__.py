"""The compiled loops over the cells of a map (numba)."""

from llm_astar_planner.search.kernel_cache import prepare_cache

prepare_cache(__file__)
