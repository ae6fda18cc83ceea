"""The `coarse` source: what it answers, in time, the same to all threads."""

import math
from concurrent.futures import ThreadPoolExecutor

import numpy as np
from llm_astar_msgs_adapter.maps.grid_map import OCCUPIED, GridMap
from llm_astar_planner.costmap.costmap import Costmap
from llm_astar_planner.waypoints.config import SourceSettings, make_source
from llm_astar_planner.waypoints.source import SourceStatus, WaypointQuery

SOURCE = make_source(SourceSettings(source='coarse'))


def walled(side=120):
    """A map with a wall from the top to a gap, and a closed corner."""
    cells = np.zeros((side, side), dtype=np.int8)
    cells[10:, side // 2] = OCCUPIED
    cells[-20:, -20] = OCCUPIED
    cells[-20, -20:] = OCCUPIED
    return Costmap(GridMap(cells))


def test_it_answers_with_the_free_cells_where_the_route_turns():
    costmap = walled()
    reply = SOURCE.waypoints(WaypointQuery(costmap, (5, 100), (90, 90)))
    assert (reply.label, reply.status, reply.detail) == ('coarse', SourceStatus.OK, '')
    assert 1 <= len(reply.waypoints) <= 4
    assert any(math.dist(point, (60, 9)) < 4 for point in reply.waypoints)
    assert not any(costmap.blocked[int(y), int(x)] for x, y in reply.waypoints)


def test_no_turns_and_no_route_are_no_waypoints():
    for start, goal in (((5, 5), (5, 5)), ((5, 5), (50, 90)), ((5, 5), (110, 110))):
        reply = SOURCE.waypoints(WaypointQuery(walled(), start, goal))
        assert (reply.status, reply.waypoints) == (SourceStatus.NO_WAYPOINTS, ())
    assert reply.detail == 'no cells connect start and goal'


def test_a_time_limit_that_is_too_short_is_a_timeout():
    query = WaypointQuery(walled(), (5, 100), (90, 90), time_limit=0.0)
    reply = SOURCE.waypoints(query)
    assert (reply.status, reply.waypoints) == (SourceStatus.TIMEOUT, ())


def test_many_threads_get_the_same_answers():
    costmap = walled(300)
    random = np.random.default_rng(1)
    free = np.argwhere(~costmap.blocked)[:, ::-1]
    ends = random.integers(0, len(free), (60, 2))
    asked = [
        WaypointQuery(costmap, tuple(map(int, free[a])), tuple(map(int, free[b]))) for a, b in ends
    ]
    alone = [SOURCE.waypoints(query) for query in asked]
    with ThreadPoolExecutor(8) as pool:
        assert list(pool.map(SOURCE.waypoints, asked * 3)) == alone * 3
    lengths = [math.dist(query.start, query.goal) for query in asked]
    assert max(lengths) > 100
