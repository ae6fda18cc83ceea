"""The names of the search methods and heuristics, for tables and messages that run no search."""

GUIDED = 'guided'
EXACT = 'exact_astar'
# The paper's, which `search.paper` has by these names.
PAPER_NAMES = ('astar', 'weighted_astar', 'dynamic_weighted_astar', 'llm_astar')
# Of our own searches, the first two, paths carry a suboptimality bound: docs/guided-search.md.
METHODS = (GUIDED, EXACT, *PAPER_NAMES)
# The methods that use waypoints; the others never query a source.
WAYPOINT_METHODS = frozenset({GUIDED, 'llm_astar'})
# How the paper's methods estimate the distance to the goal.
HEURISTIC_NAMES = ('euclidean', 'octile', 'chebyshev', 'manhattan')
