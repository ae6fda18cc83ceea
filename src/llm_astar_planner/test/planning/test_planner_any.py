"""Whatever the map, the rules and the request: no crash, always a code, never a bad path."""

import math
from dataclasses import dataclass

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from llm_astar_msgs_adapter.maps.grid_map import GridMap
from llm_astar_planner.costmap.config import CostmapConfig
from llm_astar_planner.planning.planner import Planner
from llm_astar_planner.planning.types import PlanRequest, ResultCode
from llm_astar_planner.search.methods import METHODS
from llm_astar_planner.waypoints.source import WaypointReply


@dataclass(frozen=True)
class Source:
    """Answers with any points at all."""

    points: tuple
    name = 'any'

    def waypoints(self, query):
        return WaypointReply(self.points)


@st.composite
def maps(draw, least=1, most_occupied=1.0):
    height, width = draw(st.integers(least, 24)), draw(st.integers(least, 24))
    random = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    occupied = draw(st.sampled_from([0.0, 0.05, 0.1, most_occupied]))
    cells = np.where(random.random((height, width)) < occupied, 100, 0)
    cells[random.random((height, width)) < draw(st.sampled_from([0.0, 0.2]))] = -1
    dear = random.random((height, width)) < draw(st.sampled_from([0.0, 0.3]))
    cells = np.where(dear & (cells == 0), random.integers(1, 100, (height, width)), cells)
    return GridMap(cells.astype(np.int8), draw(st.sampled_from([0.05, 0.3, 1.0])))


@st.composite
def rules(draw, radii=(0.0, 0.05, 0.3, 10.0)):
    return CostmapConfig(
        occupied_threshold=draw(st.sampled_from([65, 99, 100, 1])),
        allow_unknown=draw(st.booleans()),
        corner_cutting=draw(st.booleans()),
        cost_travel_multiplier=draw(st.sampled_from([0.0, 2.0, 100.0])),
        robot_radius=draw(st.sampled_from(radii)),
        inflation_radius=draw(st.sampled_from([0.0, 0.2, 3.0])),
        cost_scaling_factor=draw(st.sampled_from([0.0, 3.0, 1000.0])),
        unknown_cost=draw(st.sampled_from([0, 98])),
    )


near = st.tuples(st.integers(-2, 25), st.integers(-2, 25))
far = st.tuples(st.integers(), st.integers())
waypoints = st.lists(st.tuples(st.floats(), st.floats()) | near, max_size=6)
anywhere = st.one_of(near, near, near, far)
metres = st.sampled_from([0.0, 0.05, 0.5, 3.0, 1000.0])
any_number = st.one_of(metres, metres, metres, metres, st.floats())
requests = st.builds(
    PlanRequest,
    start=anywhere,
    goal=anywhere,
    method=st.sampled_from([*METHODS, 'theta']),
    source=st.none() | st.builds(Source, waypoints.map(tuple)),
    max_suboptimality=st.sampled_from([None, 1.0, 1.2, 1000.0, math.nan]),
    time_limit=st.sampled_from([10.0, 5.0, 1.0, math.inf, 0.0, math.nan]),
    any_angle=st.booleans(),
    want_expanded=st.booleans(),
    search_while_waiting=st.booleans(),
    tolerance=any_number,
    start_tolerance=any_number,
    via=st.lists(near, max_size=3).map(tuple) | st.lists(far, max_size=1).map(tuple),
    viapoints=st.just(()) | st.lists(near | far, max_size=3).map(tuple),
)
# Requests that a path may well answer: cells on or near the map, sound numbers.
sound = st.builds(
    PlanRequest,
    start=st.tuples(st.integers(0, 9), st.integers(0, 9)),
    goal=st.tuples(st.integers(0, 14), st.integers(0, 14)),
    method=st.sampled_from(METHODS),
    time_limit=st.just(100.0),
    any_angle=st.booleans(),
    tolerance=st.sampled_from([10.0, 1.0, 0.0]),
    start_tolerance=st.sampled_from([10.0, 1.0, 0.0]),
    via=st.lists(st.tuples(st.integers(0, 9), st.integers(0, 9)), max_size=2).map(tuple),
)


def stands(cell, grid_map, rules):
    """Whether the robot may be at a cell, from the definition."""
    value = grid_map.cells[cell[1], cell[0]]
    if value >= rules.occupied_threshold or (value < 0 and not rules.allow_unknown):
        return False
    lethal = np.argwhere(grid_map.cells >= rules.occupied_threshold)[:, ::-1]
    distance = np.hypot(*(lethal - cell).T).min(initial=math.inf) * grid_map.resolution
    return distance > rules.robot_radius


@settings(max_examples=150)
@given(maps(), rules(), requests)
def test_always_a_code(grid_map, rules, request):
    assert_sound(Planner(grid_map, rules).plan(request), grid_map, rules, request)


@settings(max_examples=350)
@given(maps(least=10, most_occupied=0.3), rules(radii=(0.0, 0.05, 0.1)), sound)
def test_never_a_bad_path(grid_map, rules, request):
    plan = Planner(grid_map, rules).plan(request)
    assert plan.code is not ResultCode.TIMEOUT
    assert_sound(plan, grid_map, rules, request)


def assert_sound(plan, grid_map, rules, request):
    assert plan.code in ResultCode
    assert plan.code is not ResultCode.UNKNOWN, plan.message  # the last check finds nothing
    if plan.code is not ResultCode.NONE:
        assert plan.message
        assert len(plan.path) == 0
        return
    path = [tuple(cell) for cell in plan.path.tolist()]
    assert (path[0], path[-1]) == (plan.start, plan.goal)
    assert all(stands(cell, grid_map, rules) for cell in path)
    assert (np.abs(np.diff(plan.path, axis=0)).max(axis=1, initial=1) == 1).all()
    assert math.dist(request.start, plan.start) * grid_map.resolution <= request.start_tolerance
    assert math.dist(request.goal, plan.goal) * grid_map.resolution <= request.tolerance
    moved = (plan.start_shift > 0, plan.goal_shift > 0, plan.via != request.via)
    assert len(plan.warnings) == sum(moved)
    place = 0
    for requested, cell in zip(request.via, plan.via, strict=True):
        place = path.index(cell, place)
        assert math.dist(requested, cell) * grid_map.resolution <= request.tolerance
    assert plan.clearance > rules.robot_radius or plan.clearance == math.inf
    assert plan.length >= math.dist(plan.start, plan.goal) - 1e-9
    if plan.any_angle is not None:
        assert plan.any_angle.length <= plan.length + 1e-9
