"""What a picture of a plan shows."""

import numpy as np
from llm_astar_msgs_adapter.maps.grid_map import GridMap
from llm_astar_planner.planning.footprint import Footprint
from llm_astar_planner.planning.planner import Planner
from llm_astar_planner.planning.types import PlanRequest
from llm_astar_planner.visualization.figures import draw, picture_of
from matplotlib.collections import PolyCollection
from matplotlib.figure import Figure

MAP = GridMap(np.zeros((40, 60), np.int8), 0.1)


def outlines_of(plan, offset=(0, 0)):
    """The corners of each outline that is drawn for a plan."""
    axes = Figure().add_subplot()
    draw(axes, picture_of(plan, MAP, plan.start, plan.goal, offset))
    drawn = [item for item in axes.collections if isinstance(item, PolyCollection)]
    return [path.vertices[:-1] for item in drawn for path in item.get_paths()]


def test_the_robots_outline_is_drawn_along_the_path_in_its_direction():
    footprint = Footprint(((0.5, 0.1), (0.5, -0.1), (-0.2, -0.1), (-0.2, 0.1)))
    planner = Planner(MAP)
    outlines = outlines_of(planner.plan(PlanRequest((20, 8), (20, 33), footprint=footprint)))
    assert len(outlines) >= 3
    # It looks up: what is ahead of the robot is above the start.
    assert np.allclose(outlines[0], [(19, 13), (21, 13), (21, 6), (19, 6)])
    moved = outlines_of(
        planner.plan(PlanRequest((20, 8), (20, 33), footprint=footprint)), (100, 7)
    )
    assert np.allclose(moved[0], outlines[0] + (100, 7))
    assert outlines_of(planner.plan(PlanRequest((20, 8), (20, 33)))) == []
