"""Paths for a robot that is no circle: they are free all along, and the cheapest of those."""

import heapq
import math
from itertools import pairwise

import numpy as np
import pytest
import shapely
from llm_astar_msgs_adapter.maps.grid_map import GridMap, Pose2D
from llm_astar_planner.costmap.config import CostmapConfig
from llm_astar_planner.instructions.clauses.avoid import Avoid
from llm_astar_planner.instructions.clauses.visit import Visit
from llm_astar_planner.instructions.interpretation import (
    Interpretation,
    RouteInstruction,
    Understanding,
)
from llm_astar_planner.instructions.regions import Disc
from llm_astar_planner.instructions.specification import Specification
from llm_astar_planner.planning.compile import compile_footprint_kernels
from llm_astar_planner.planning.footprint import Footprint
from llm_astar_planner.planning.footprint_search import FootprintChecker
from llm_astar_planner.planning.plan_reuse import reuse_problem
from llm_astar_planner.planning.planner import Planner
from llm_astar_planner.planning.types import PlanRequest, ResultCode
from scipy import ndimage
from shapely import affinity

# One metre long, 0.5 m wide; its circle of 0.56 m does not fit into the corridors below.
LONG = Footprint.parse('[[0.5, 0.25], [0.5, -0.25], [-0.5, -0.25], [-0.5, 0.25]]')
PATIENCE = 120.0
STEPS = [(1, 0), (1, 1), (0, 1), (-1, 1), (-1, 0), (-1, -1), (0, -1), (1, -1)]


def planner_of(cells, resolution=0.05, **rules) -> Planner:
    rules = {'robot_radius': 0.2} | rules
    grid_map = GridMap(np.asarray(cells, np.int8), resolution)
    return Planner(grid_map, CostmapConfig(**rules))


def request_of(*fields, **named) -> PlanRequest:
    # Searches that have to be compiled first take longer than the default.
    return PlanRequest(*fields, time_limit=PATIENCE, **named)


def corridors(*areas, size=200) -> np.ndarray:
    """A map that is lethal but for areas (left, right, top, bottom) in cells."""
    cells = np.full((size, size), 100, np.int8)
    for left, right, top, bottom in areas:
        cells[top:bottom, left:right] = 0
    return cells


def obstacles_of(planner, threshold=65):
    """All lethal cells, and all around the map, as one prepared shape in grid coordinates."""
    height, width = planner.grid_map.cells.shape
    lethal = np.pad(planner.grid_map.cells >= threshold, ((0, 0), (1, 1))).astype(np.int8)
    y, first = np.nonzero(np.diff(lethal) == 1)
    _, last = np.nonzero(np.diff(lethal) == -1)
    boxes = shapely.box(first - 0.5, y - 0.5, last - 0.5, y + 0.5)
    inside = shapely.box(-0.5, -0.5, width - 0.5, height - 0.5)
    shape = shapely.union_all([*boxes, shapely.box(-99, -99, width + 99, height + 99) - inside])
    shape = shape.buffer(-1e-9)
    shapely.prepare(shape)
    return shape


def polygon_at(footprint, resolution, x, y, yaw):
    polygon = shapely.Polygon(np.array(footprint.points) / resolution)
    return affinity.translate(affinity.rotate(polygon, yaw, (0, 0), use_radians=True), x, y)


def assert_passes(plan, planner, footprint, start_yaw=None, goal_yaw=None, threshold=65):
    """Move the polygon along the path in small steps, and turn it where the path turns."""
    obstacles, resolution = obstacles_of(planner, threshold), planner.grid_map.resolution

    def free(x, y, yaw):
        return not obstacles.intersects(polygon_at(footprint, resolution, x, y, yaw))

    def can_turn(x, y, begin, end):
        angle = (end - begin + math.pi) % (2 * math.pi) - math.pi
        ways = angle, angle - math.copysign(2 * math.pi, angle)
        return any(all(free(x, y, begin + way * n / 90) for n in range(91)) for way in ways)

    yaw = start_yaw
    points = (plan.path if plan.any_angle is None else plan.any_angle.points).tolist()
    for (x, y), (far_x, far_y) in pairwise(points):
        ahead = math.atan2(far_y - y, far_x - x)
        assert yaw is None or yaw == ahead or can_turn(x, y, yaw, ahead), (x, y, yaw, ahead)
        yaw = ahead
        for share in np.linspace(0.0, 1.0, 5 * math.ceil(math.dist((x, y), (far_x, far_y))) + 1):
            here = x + (far_x - x) * share, y + (far_y - y) * share
            assert free(*here, yaw), (here, yaw)
    if goal_yaw is not None:
        assert can_turn(*points[-1], goal_yaw if yaw is None else yaw, goal_yaw)


L_WITH_ROOM = corridors((10, 90, 50, 64), (90, 120, 45, 75), (98, 112, 75, 180))
L_WITHOUT_ROOM = corridors((10, 112, 50, 64), (98, 112, 50, 180))


@pytest.fixture(scope='module', autouse=True)
def _compiled():
    compile_footprint_kernels()  # else a slow compilation counts as planning time


@pytest.mark.parametrize('method', ['guided', 'exact_astar', 'astar'])
def test_a_long_robot_passes_a_corridor_aligned_and_turns_where_there_is_room(method):
    planner = planner_of(L_WITH_ROOM)
    start = Pose2D(1.5, 2.85, 0.0)
    request = request_of(
        (30, 57), (104, 160), method, footprint=LONG, start_pose=start, goal_yaw=math.pi / 2
    )
    plan = planner.plan(request)
    assert plan.code is ResultCode.NONE, plan.message
    assert_passes(plan, planner, LONG, 0.0, math.pi / 2)


def test_a_corner_without_room_to_turn_has_no_path_and_the_message_names_the_place():
    planner = planner_of(L_WITHOUT_ROOM)
    assert planner.plan(request_of((30, 57), (104, 160))).code is ResultCode.NONE
    plan = planner.plan(request_of((30, 57), (104, 160), footprint=LONG, tolerance=0.5))
    assert plan.code is ResultCode.NO_VALID_PATH
    assert 'no path fits the footprint (4 points, radii 0.25 m inscribed' in plan.message
    x, y = map(float, plan.message.split('than (')[1].split(') m')[0].split(', '))
    assert math.dist((x, y), (5.2, 2.85)) < 1.0
    assert len(plan.path) == 0


def test_a_longer_way_is_taken_where_the_short_one_is_too_narrow():
    # Two doors in a wall: a near one of 0.4 m, a far one of 0.8 m.
    cells = np.zeros((120, 120), np.int8)
    cells[:, 60] = 100
    cells[30:38, 60] = 0
    cells[90:106, 60] = 0
    planner = planner_of(cells, robot_radius=0.1)
    request = request_of((30, 34), (90, 34))
    assert planner.plan(request).path[:, 1].max() < 60
    wide = request_of((30, 34), (90, 34), footprint=LONG)
    plan = planner.plan(wide)
    assert plan.path[:, 1].max() >= 90
    assert_passes(plan, planner, LONG)
    assert plan.message.count('searched by heading') == 1


def test_a_t_junction_is_turned_through_at_its_crossing():
    cells = corridors((10, 190, 90, 104), (93, 107, 100, 190), (84, 116, 82, 112))
    planner = planner_of(cells)
    for goal, yaw in (((30, 97), math.pi), ((170, 97), 0.0)):
        request = request_of((100, 170), goal, footprint=LONG, goal_yaw=yaw)
        plan = planner.plan(request)
        assert plan.code is ResultCode.NONE, plan.message
        assert_passes(plan, planner, LONG, goal_yaw=yaw)


def test_a_path_that_fits_is_left_as_it_is():
    planner = planner_of(np.zeros((80, 80)))
    request = request_of((20, 20), (60, 50))
    fitted = request_of((20, 20), (60, 50), footprint=LONG, goal_yaw=1.0)
    plain, plan = planner.plan(request), planner.plan(fitted)
    assert plan.path.tolist() == plain.path.tolist()
    assert plan.message == plain.message


def test_every_better_path_on_the_way_passes():
    rng = np.random.default_rng(3)
    cells = (rng.random((150, 150)) < 0.0015).astype(np.int8) * 100
    cells[10:20, 10:20] = cells[130:140, 130:140] = 0
    planner = planner_of(cells, robot_radius=0.1)
    request = request_of((15, 15), (135, 135), footprint=LONG, max_suboptimality=1.0)
    plans = list(planner.plans(request))
    assert plans[-1].code is ResultCode.NONE
    for plan in plans:
        assert_passes(plan, planner, LONG)


def test_a_path_through_via_points_passes():
    planner = planner_of(corridors((5, 195, 5, 45), (150, 164, 40, 160), (100, 195, 150, 195)))
    request = request_of((20, 25), (120, 170), via=((157, 100), (180, 170)), footprint=LONG)
    plan = planner.plan(request)
    assert plan.code is ResultCode.NONE, plan.message
    assert_passes(plan, planner, LONG)


def test_a_path_at_any_angle_is_given_only_where_the_footprint_passes_it():
    planner = planner_of(np.zeros((80, 80)))
    request = request_of((20, 20), (60, 50), footprint=LONG, any_angle=True)
    assert planner.plan(request).any_angle is not None
    # It would cut the corner of the room in which the robot has to turn.
    request = request_of((30, 57), (104, 160), footprint=LONG, any_angle=True)
    planner = planner_of(L_WITH_ROOM)
    plan = planner.plan(request)
    assert plan.code is ResultCode.NONE
    assert plan.any_angle is None
    assert any('any angle is left out' in warning for warning in plan.warnings)


def test_inscribed_cells_of_a_costmap_do_not_stop_the_polygon():
    # 0.25 m of inscribed cells around walls 0.7 m apart, as Nav2 publishes them.
    cells = L_WITH_ROOM.copy()
    inflated = planner_of(cells, robot_radius=0.25).costmap.blocked
    cells[inflated & (cells == 0)] = 99
    planner = planner_of(cells, robot_radius=0.0, occupied_threshold=99)
    plan = planner.plan(request_of((30, 57), (104, 160), footprint=LONG))
    assert plan.code is ResultCode.NONE, plan.message
    assert_passes(plan, planner, LONG, threshold=100)


def test_a_robot_that_touches_an_obstacle_where_it_stands_may_start():
    cells = np.zeros((80, 80), np.int8)
    cells[20, 28] = 100
    start = Pose2D(1.02, 1.02, 0.0)
    planner = planner_of(cells)
    request = request_of((20, 20), (60, 60), footprint=LONG, start_pose=start)
    plan = planner.plan(request)
    assert plan.code is ResultCode.NONE, plan.message
    assert any('cells under it count as free' in warning for warning in plan.warnings)
    # The cells that it does not touch stay obstacles.
    cells[5:36, 30] = 100
    planner = planner_of(cells)
    plan = planner.plan(request)
    assert plan.code is ResultCode.NONE, plan.message
    cells[20, 28] = 0
    assert_passes(plan, planner_of(cells), LONG)


def test_a_robot_in_an_aisle_that_looks_the_other_way_gets_a_path_and_a_warning():
    planner = planner_of(corridors((10, 190, 90, 104)))
    start = Pose2D(5.025, 4.85, math.pi)
    request = request_of((100, 96), (160, 96), footprint=LONG, start_pose=start)
    plan = planner.plan(request)
    assert plan.code is ResultCode.NONE, plan.message
    assert any('cannot turn on the spot at the start' in warning for warning in plan.warnings)
    # At the goal it has to be able to.
    behind = request_of((100, 96), (160, 96), footprint=LONG, goal_yaw=math.pi)
    assert planner.plan(behind).code is ResultCode.NO_VALID_PATH


def test_the_goal_moves_within_the_tolerance_to_where_the_footprint_fits():
    cells = np.zeros((100, 100), np.int8)
    cells[:, 80:] = 100
    planner = planner_of(cells)
    # 0.3 m from the wall, which it would look at.
    request = request_of((30, 50), (74, 50), footprint=LONG, goal_yaw=0.0)
    plan = planner.plan(request)
    assert plan.code is ResultCode.GOAL_OCCUPIED
    assert 'it meets an obstacle at the goal (74, 50)' in plan.message
    near = request_of((30, 50), (74, 50), footprint=LONG, goal_yaw=0.0, tolerance=0.5)
    plan = planner.plan(near)
    assert plan.code is ResultCode.NONE, plan.message
    assert plan.goal == (69, 50)
    assert plan.goal_shift == pytest.approx(0.25)
    assert_passes(plan, planner, LONG, goal_yaw=0.0)
    far = request_of((30, 50), (74, 50), footprint=LONG, goal_yaw=0.0, tolerance=0.1)
    assert planner.plan(far).code is ResultCode.NO_VALID_PATH


def test_a_goal_that_only_a_circle_reaches_moves_to_the_nearest_cell_that_is_reached():
    # A niche that is entered around a corner.
    planner = planner_of(corridors((10, 112, 50, 64), (98, 112, 50, 100)))
    request = request_of((30, 57), (104, 80), footprint=LONG, tolerance=3.0)
    plan = planner.plan(request)
    assert plan.code is ResultCode.NONE, plan.message
    assert plan.goal_shift > 0.5
    assert_passes(plan, planner, LONG)


@pytest.mark.parametrize('resolution', [1e-4, 2.0])
def test_footprints_of_very_many_or_no_cells_are_planned_for_or_refused(resolution):
    planner = planner_of(np.zeros((60, 60)), resolution, robot_radius=0.0)
    plan = planner.plan(request_of((10, 10), (50, 50), footprint=LONG))
    assert plan.code is (ResultCode.NONE if resolution > 1.0 else ResultCode.UNKNOWN)


def test_time_limits_and_cancels_end_the_search_by_heading():
    planner = planner_of(L_WITHOUT_ROOM)
    stop = np.ones(1, np.uint8)
    assert planner.plan(request_of((30, 57), (104, 160), footprint=LONG), stop).code in {
        ResultCode.TIMEOUT, ResultCode.NO_VALID_PATH,
    }  # fmt: skip


def oracle_costs(planner, footprint, start, margin):
    """The least cost from a cell to any other, by Dijkstra over cells and headings in Python."""
    obstacles = obstacles_of(planner)
    base = shapely.Polygon(np.array(footprint.points) / planner.grid_map.resolution).buffer(margin)
    regions = []
    for heading, (step_x, step_y) in enumerate(STEPS):
        turned = affinity.rotate(base, 45 * heading, (0, 0))
        parts = [affinity.translate(turned, step_x * n / 40, step_y * n / 40) for n in range(41)]
        regions.append(shapely.union_all(parts))
    for heading in range(8):
        parts = [affinity.rotate(base, 45 * heading + n, (0, 0)) for n in range(46)]
        regions.append(shapely.union_all(parts))
    height, width = planner.grid_map.cells.shape
    blocked = planner.costmap.blocked
    memo = {}

    def free(cell, motion):
        if (cell, motion) not in memo:
            memo[cell, motion] = not obstacles.intersects(
                affinity.translate(regions[motion], *cell)
            )
        return memo[cell, motion]

    costs = {}
    queue = [(0.0, start, heading) for heading in range(8)]
    while queue:
        cost, cell, heading = heapq.heappop(queue)
        if (cell, heading) in costs:
            continue
        costs[cell, heading] = cost
        (x, y), (step_x, step_y) = cell, STEPS[heading]
        for other, motion in (
            ((heading + 1) % 8, heading),
            ((heading - 1) % 8, (heading - 1) % 8),
        ):
            if free(cell, 8 + motion):
                heapq.heappush(queue, (cost, cell, other))
        ahead = x + step_x, y + step_y
        if not (0 <= ahead[0] < width and 0 <= ahead[1] < height):
            continue
        around = {ahead, (x + step_x, y), (x, y + step_y)}
        if not any(blocked[row, column] for column, row in around) and free(cell, heading):
            heapq.heappush(queue, (cost + math.hypot(step_x, step_y), ahead, heading))
    return {cell: min(costs.get((cell, h), math.inf) for h in range(8)) for cell, _ in costs}


@pytest.mark.parametrize('seed', range(2))
def test_paths_are_the_cheapest_that_an_oracle_finds(seed):
    rng = np.random.default_rng(seed)
    cells = (rng.random((24, 28)) < 0.05).astype(np.int8) * 100
    start = 6, 6
    cells[2:11, 2:11] = 0
    fork = Footprint(((-0.4, -0.3), (0.5, -0.3), (0.0, 0.0), (0.5, 0.3), (-0.4, 0.3)))
    footprint = (Footprint.parse('[[0.4,0.1],[0.4,-0.1],[-0.3,-0.1],[-0.3,0.1]]'), fork)[seed % 2]
    planner = planner_of(cells, 0.2, robot_radius=0.0)
    exact = oracle_costs(planner, footprint, start, 0.0)
    wider = oracle_costs(planner, footprint, start, 0.3)
    found = 0
    for goal in map(tuple, rng.integers((0, 0), (28, 24), (40, 2)).tolist()):
        if planner.costmap.blocked[goal[1], goal[0]]:
            continue
        plan = planner.plan(request_of(start, goal, footprint=footprint, max_suboptimality=1.0))
        assert (plan.code is ResultCode.NONE) >= math.isfinite(wider.get(goal, math.inf))
        if plan.code is ResultCode.NONE:
            found += 1
            assert plan.length >= exact[goal] - 1e-6
            assert plan.length <= wider.get(goal, math.inf) + 1e-6
            assert_passes(plan, planner, footprint)
    assert found


def test_a_path_is_kept_only_where_the_footprint_passes_it_on_the_new_map():
    cells = np.zeros((100, 100), np.int8)
    before = planner_of(cells)
    plan = before.plan(request_of((20, 50), (80, 50), footprint=LONG))
    # 0.25 m beside the path: free for a circle of 0.2 m, not for the polygon.
    cells[55, 50] = 100
    after = planner_of(cells)
    assert reuse_problem(plan, before.grid_map, after) is None
    assert 'meets an obstacle on it' in reuse_problem(plan, before.grid_map, after, LONG)
    assert reuse_problem(plan, before.grid_map, before, LONG) is None


def instructed(planner, policy, *clauses):
    instruction = RouteInstruction(
        Interpretation('text', Specification(clauses), 'truth', Understanding.WHOLE), policy=policy
    )
    return planner.plan(request_of((30, 57), (104, 160), footprint=LONG, instruction=instruction))


def test_a_path_that_keeps_to_an_instruction_passes_or_gives_way_to_one_that_does():
    planner = planner_of(L_WITH_ROOM)
    # The lower half of the room is enough to turn in.
    plan = instructed(planner, 'require', Avoid(region=Disc(4.7, 2.35, 0.1)))
    assert plan.code is ResultCode.NONE, plan.message
    assert_passes(plan, planner, LONG)
    # A path with a visit is not searched by heading: the direct one is taken, or none.
    visit = Visit(regions=(Disc(5.8, 2.5, 0.2),))
    plan = instructed(planner, 'prefer', visit)
    assert plan.code is ResultCode.NONE, plan.message
    assert_passes(plan, planner, LONG)
    plan = instructed(planner, 'require', visit)
    if plan.code is ResultCode.NONE:
        assert_passes(plan, planner, LONG)
    else:
        assert plan.code is ResultCode.NO_VALID_PATH


def test_the_last_check_finds_what_the_search_would_have_missed(monkeypatch):
    planner = planner_of(L_WITHOUT_ROOM)
    monkeypatch.setattr(FootprintChecker, 'path_collides', lambda *_: False)
    plan = planner.plan(request_of((30, 57), (104, 160), footprint=LONG))
    assert plan.code is ResultCode.UNKNOWN
    assert 'withheld: the footprint meets an obstacle at' in plan.message


def test_the_footprint_is_of_the_robots_frame_on_a_turned_map():
    # The same corridor on a map that is turned by 0.6 rad: yaws are those of the map's frame.
    origin = Pose2D(4.0, -7.0, 0.6)
    planner = Planner(GridMap(L_WITH_ROOM, 0.05, origin), CostmapConfig(robot_radius=0.2))
    x, y = planner.grid_map.grid_to_world([(30, 57)])[0]
    request = request_of(
        (30, 57), (104, 160), footprint=LONG, start_pose=Pose2D(x, y, 0.6),
        goal_yaw=0.6 + math.pi / 2,
    )  # fmt: skip
    plan = planner.plan(request)
    assert plan.code is ResultCode.NONE, plan.message
    assert plan.warnings == ()
    assert_passes(plan, planner, LONG, 0.0, math.pi / 2)


def random_request(rng, planner):
    """A request between free cells, with a random polygon, yaws and options."""
    count = rng.integers(3, 8)
    angles = (np.arange(count) + rng.uniform(0, 0.4, count)) * 2 * math.pi / count
    radii = rng.uniform(0.05, 0.5, (2, 1)) * rng.uniform(0.3, 1.0, count)
    free = np.argwhere(~planner.costmap.blocked)[:, ::-1]
    start, goal, *via = map(tuple, free[rng.integers(len(free), size=3)].tolist())
    pose = None
    if rng.random() < 0.6:
        place = planner.grid_map.grid_to_world([rng.uniform(-0.49, 0.49, 2) + start])[0]
        pose = Pose2D(*place.tolist(), rng.uniform(-4, 4))
    return request_of(
        start,
        goal,
        str(rng.choice(['guided', 'astar'])),
        footprint=Footprint.of(np.column_stack([np.cos(angles), np.sin(angles)]) * radii.T),
        start_pose=pose,
        goal_yaw=rng.uniform(-4, 4) if rng.random() < 0.5 else None,
        via=tuple(via) if rng.random() < 0.2 else (),
        tolerance=float(rng.choice([0.0, 0.5])),
        start_tolerance=float(rng.choice([0.0, 0.25])),
        any_angle=bool(rng.random() < 0.3),
        max_suboptimality=1.0,
    )


@pytest.mark.parametrize('seed', range(3))
def test_no_path_is_returned_that_a_random_polygon_does_not_pass(seed):
    rng = np.random.default_rng(seed)
    noise = ndimage.gaussian_filter(rng.random((50, 60)), 1.5)
    cells = (noise < np.quantile(noise, 0.05)).astype(np.int8) * 100
    origin = Pose2D(2.0, -3.0, 0.7 * seed)
    planner = Planner(GridMap(cells, 0.05, origin), CostmapConfig(robot_radius=0.05))
    found = 0
    for _ in range(25):
        request = random_request(rng, planner)
        *better, plan = planner.plans(request)
        assert plan.code is not ResultCode.UNKNOWN, plan.message
        warnings = ' '.join(plan.warnings)
        if plan.code is not ResultCode.NONE or 'count as free' in warnings:
            continue
        found += 1
        pose, goal_yaw = request.start_pose, request.goal_yaw
        turns = pose is not None and 'cannot turn' not in warnings
        yaws = (
            pose.yaw - origin.yaw if turns else None,
            None if goal_yaw is None else goal_yaw - origin.yaw,
        )
        for one in (*better, plan):
            assert_passes(one, planner, request.footprint, *yaws)
    assert found > 5
