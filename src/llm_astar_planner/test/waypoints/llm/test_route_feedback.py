"""The faults of a route, and the sentences that name them."""

import numpy as np
from llm_astar_msgs_adapter.maps.grid_map import GridMap
from llm_astar_planner.costmap.costmap import Costmap
from llm_astar_planner.waypoints.prompts.examples import MAX_FAULTS_NAMED, find_faults, follow_up
from llm_astar_planner.waypoints.prompts.map_description import Lattice
from llm_astar_planner.waypoints.source import WaypointQuery


def test_the_faults_of_a_route_are_found_and_named():
    cells = np.zeros((30, 50), dtype=np.int8)
    cells[10, 0:26] = 100
    costmap = Costmap(GridMap(cells))
    lattice = Lattice(unit=5)
    assert find_faults(WaypointQuery(costmap, (5, 5), (30, 20)), [(28.0, 9.0)], lattice) == []
    assert find_faults(WaypointQuery(costmap, (5, 5), (5, 5)), [], lattice) == []
    points = [(5.0, 10.0), (-1.0, 3.0), (1e9, 0.0)]
    faults = find_faults(WaypointQuery(costmap, (5, 5), (5, 20)), points, lattice)
    assert faults == [
        '- The point [1, 2] lies on a barrier.',
        '- The point [-1, 0] lies off the map.',
        '- The point [200000000, 0] lies off the map.',
        '- The straight way from [1, 1] to [1, 4] meets a barrier at [1, 2].',
    ]
    assert '\n'.join(faults) in follow_up(faults)
    many = follow_up(faults * 5)
    assert many.count('\n- ') == MAX_FAULTS_NAMED + 1
    assert 'and 12 more like these' in many
