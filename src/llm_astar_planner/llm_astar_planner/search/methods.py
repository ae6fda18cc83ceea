"""The names of the search methods and heuristics, for tables and messages that run no search."""

from llm_astar_planner.plugins import Plugins
from llm_astar_planner.search.plugins import make_plugin_method

GUIDED = 'guided'
EXACT = 'exact_astar'
# The paper's, which `search.paper` has by these names.
PAPER_NAMES = ('astar', 'weighted_astar', 'dynamic_weighted_astar', 'llm_astar')
# The package's own by name, in the order in which they are listed; each is a SearchMethod.
# Of our own searches, the first two, paths carry a suboptimality bound: docs/guided-search.md.
HERE = 'llm_astar_planner.search'
SEARCH_METHODS = Plugins(
    'search method',
    'llm_astar.search_methods',
    {
        GUIDED: f'{HERE}.guided:guided_method',
        EXACT: f'{HERE}.astar:exact_method',
        **{name: f'{HERE}.paper:{name}_method' for name in PAPER_NAMES},
    },
    make_plugin_method,
    # What `bench` calls rows without a search, now and before.
    frozenset({'waypoints_only', 'llm_only'}),
)
METHODS = tuple(SEARCH_METHODS.own)
# Of these, the methods that use waypoints; the others never query a source.
WAYPOINT_METHODS = frozenset({GUIDED, 'llm_astar'})
# How the paper's methods estimate the distance to the goal.
HEURISTIC_NAMES = ('euclidean', 'octile', 'chebyshev', 'manhattan')


def uses_waypoints(name: str) -> bool:
    """Tell whether a method may use waypoints; that of a plug-in says so once it is loaded."""
    if name in METHODS:
        return name in WAYPOINT_METHODS
    plugin = SEARCH_METHODS.loaded.get(name)
    return plugin is None or bool(plugin.uses_waypoints)
