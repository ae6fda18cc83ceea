"""Plans and checks on maps of awkward sizes with hostile values, for numba's bounds check.

`NUMBA_BOUNDSCHECK=1 NUMBA_CACHE_DIR=FOLDER python test/bounds_checked.py METHODS SIDES ROUNDS`
prints how much it tried; an index out of bounds ends it with an IndexError. The folder must be one
of its own: what is compiled is kept there with its checks.
"""

import itertools
import sys

import numpy as np
from llm_astar_msgs_adapter.maps.grid_map import GridMap, Pose2D
from llm_astar_planner.costmap.config import CostmapConfig
from llm_astar_planner.planning.footprint import Footprint
from llm_astar_planner.planning.path_validator import invalid_poses
from llm_astar_planner.planning.planner import Planner
from llm_astar_planner.planning.types import PlanRequest
from llm_astar_planner.waypoints.source import SourceStatus, WaypointReply

ROBOT = Footprint.of([[0.6, 0.4], [-0.6, 0.4], [-0.6, -0.4], [0.6, -0.4]])
SIDES = (1, 63, 64, 65, 127, 128, 129)
EDGES = (-(2**31), -129, -1, 0, 1, 62, 63, 64, 65, 126, 127, 128, 129, 2**31 - 1)
RULES = (
    CostmapConfig(),
    CostmapConfig(corner_cutting=True, robot_radius=1.2),
    CostmapConfig(inflation_radius=3.0, robot_radius=0.5, allow_unknown=False),
    CostmapConfig(inflation_radius=10.0, cost_scaling_factor=0.1),
)


class Hostile:
    """Waypoints on and off the map, at corners, and as far away as numbers go."""

    name = 'hostile'

    def __init__(self, draw, sides):
        far = (*map(float, EDGES), 1e308, -1e308, 5e-324, 63.5)
        self._points = tuple(
            (float(x), float(y))
            for x, y in (
                *draw.choice(far, (20, 2)),
                *(draw.random((20, 2)) * sides),
            )
        )

    def waypoints(self, query):
        return WaypointReply(self._points, 'hostile', SourceStatus.OK)


def hostile_map(draw, width, height):
    """Return a map of all values, empty, full, or with rooms."""
    kind = draw.integers(5)
    cells = np.zeros((height, width), dtype=np.int8)
    if kind == 1:
        cells[:] = draw.integers(-1, 101, cells.shape)
    if kind >= 2:
        cells[draw.random(cells.shape) < 0.1 * kind] = 100
        cells[draw.random(cells.shape) < 0.2] = -1
        cells[draw.random(cells.shape) < 0.2] = draw.integers(1, 99)
    cells[0, 0] = cells[-1, -1] = 0
    # Not of Python's order, and read-only, as a mapped file is.
    cells = np.asfortranarray(cells) if draw.integers(2) else cells
    cells.setflags(write=False)
    return GridMap(cells, 0.05 if draw.integers(2) else 1.0)


def plan_everywhere(draw, methods, width, height):
    """Plan by each method from corner to corner; return how many plans were made."""
    rules = RULES[draw.integers(len(RULES))]
    planner = Planner(hostile_map(draw, width, height), rules).prepare()
    corners = [(0, 0), (width - 1, height - 1), (0, height - 1), (width // 2, height // 2)]
    source, count = Hostile(draw, (width, height)), 0
    for method, (start, goal) in itertools.product(methods, itertools.pairwise(corners)):
        planner.plan(
            PlanRequest(
                start,
                goal,
                method=method,
                source=source,
                any_angle='guided' in methods,
                via=(corners[2],) if count % 3 == 0 else (),
                viapoints=(corners[3],),
                tolerance=3.0,
                start_tolerance=3.0,
                time_limit=60.0,
                max_suboptimality=1.0 if count % 2 else None,
            )
        )
        count += 1
    check_paths(draw, planner)
    return count


def check_paths(draw, planner):
    """Check paths and poses that lie anywhere, on the map and off it."""
    cells = draw.choice(EDGES, (40, 2)).astype(np.int64)
    near = np.clip(cells, -2, 130)
    invalid_poses(cells, planner.checker, allow_unknown=True, cost_limit=100)
    height, width = planner.grid_map.cells.shape
    planner.checker.is_free(np.clip(cells, 0, (width - 1, height - 1)))
    for path in (near.astype(np.int32), np.clip(cells, -(2**31), 2**31 - 1).astype(np.int32)):
        planner.checker.path_problem(path, (0, 0), (1, 1))
        planner.checker.path_problem(path[:1], tuple(path[0]), tuple(path[0]))


def plan_with_a_body(draw, width, height):
    """Plan with a footprint, by heading where it does not fit; return how many plans."""
    planner = Planner(hostile_map(draw, width, height), CostmapConfig()).prepare()
    start, goal = (0, 0), (width - 1, height - 1)
    pose = Pose2D(0.0, 0.0, float(draw.uniform(-4.0, 4.0)))
    planner.plan(
        PlanRequest(start, goal, footprint=ROBOT, start_pose=pose, goal_yaw=1.0, time_limit=60.0)
    )
    return 1


def main(methods, sides, rounds):
    draw = np.random.default_rng(7)
    sides = [int(side) for side in sides.split(',')] if sides else SIDES
    plans = 0
    for _ in range(int(rounds)):
        for side in sides:
            other = int(draw.choice(sides))
            plans += plan_everywhere(draw, methods.split(','), side, other)
            if 'guided' in methods and ROUND_BODY in sides:
                plans += plan_with_a_body(draw, side, other)
    sys.stdout.write(f'{plans} plans\n')


# A footprint compiles for long, so only the long runs have one: those with this side.
ROUND_BODY = 129

if __name__ == '__main__':
    main(*sys.argv[1:])
