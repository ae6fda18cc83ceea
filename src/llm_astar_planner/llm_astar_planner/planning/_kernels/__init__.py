"""The compiled loops of the last check (numba), independent of the searches and the costmap."""

from llm_astar_planner.search.kernel_cache import prepare_cache

prepare_cache(__file__)
