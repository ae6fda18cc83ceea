"""What is said to be least or impossible, against plain searches and against other paths."""

import heapq
import math
from itertools import pairwise, product

import numpy as np
import pytest
import shapely
from grids import is_move, shortest_path
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from llm_astar_msgs_adapter.maps.grid_map import GridMap, Pose2D
from llm_astar_msgs_adapter.maps.places import Place, Places
from llm_astar_planner.costmap.config import CostmapConfig
from llm_astar_planner.costmap.costmap import Costmap
from llm_astar_planner.instructions.clauses.avoid import Avoid
from llm_astar_planner.instructions.clauses.before import Before
from llm_astar_planner.instructions.clauses.clause import SHOULD
from llm_astar_planner.instructions.clauses.count import Count
from llm_astar_planner.instructions.clauses.end_at import EndAt
from llm_astar_planner.instructions.clauses.keep_distance import KeepDistance
from llm_astar_planner.instructions.clauses.never_after import NeverAfter
from llm_astar_planner.instructions.clauses.pass_by import Pass
from llm_astar_planner.instructions.clauses.stay_in import StayIn
from llm_astar_planner.instructions.clauses.then import Then
from llm_astar_planner.instructions.clauses.visit import Visit
from llm_astar_planner.instructions.regions import (
    AllOf,
    Along,
    AnyOf,
    Between,
    Box,
    Disc,
    End,
    Except,
    Half,
    NamedPlace,
    Tagged,
)
from llm_astar_planner.instructions.route import Route
from llm_astar_planner.instructions.specification import Specification
from llm_astar_planner.instructions.verification.geometry import disc_area, polygon_area, polyline
from llm_astar_planner.instructions.verification.keep_distance import STEP, greatest_clearance
from llm_astar_planner.instructions.verification.measurement import Measurement
from llm_astar_planner.instructions.verification.reference import Reference
from llm_astar_planner.instructions.verification.verify import verify
from llm_astar_planner.instructions.verification.walls import Walls
from llm_astar_planner.search.grid_graph import GridGraph
from path_samples import box_depth
from verified_maps import IMPOSSIBLE, SATISFIED, turned

SAMPLES = 200


@st.composite
def routes(draw, places=()):
    """A small map with obstacles, perhaps turned, two free cells on it, and a random source."""
    height, width = draw(st.integers(2, 14)), draw(st.integers(2, 14))
    random = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    blocked = random.random((height, width)) < draw(st.sampled_from([0.0, 0.1, 0.25, 0.4]))
    if draw(st.booleans()) and height > 4:
        blocked[height // 2] = True
        blocked[height // 2, random.integers(width)] = False
    cells = random.integers(0, (width, height), (2, 2))
    blocked[cells[:, 1], cells[:, 0]] = False
    origin = draw(st.sampled_from([Pose2D(0.0, 0.0), Pose2D(-0.5, -0.5), Pose2D(3.0, 1.0, 0.7)]))
    config = CostmapConfig(corner_cutting=draw(st.booleans()))
    costmap = Costmap(GridMap(blocked.astype(np.int8) * 100, 1.0, origin), config)
    start, goal = ((int(x), int(y)) for x, y in cells)
    return Route(costmap, start, goal, Places(places)), random


def least_by_dijkstra(route, depth, *, outside):
    """The least metres inside of a region, or outside, by a plain search over sampled moves."""
    graph, grid_map = route.costmap.grid_graph, route.costmap.grid_map
    best, heap = {route.start: 0.0}, [(0.0, route.start)]
    share = (np.arange(SAMPLES) + 0.5)[:, None] / SAMPLES
    while heap:
        cost, (x, y) = heapq.heappop(heap)
        if (x, y) == route.goal:
            return cost
        if cost > best[x, y]:
            continue
        for dx in (-1, 0, 1):
            for dy in (-1, 0, 1):
                other = (x + dx, y + dy)
                if (dx, dy) == (0, 0) or not is_move(graph, (x, y), other):
                    continue
                ends = grid_map.grid_to_world([(x, y), other])
                inside = (depth(ends[0] + share * (ends[1] - ends[0])) > 1e-6).mean()
                new = cost + math.hypot(dx, dy) * (1.0 - inside if outside else inside)
                if new < best.get(other, math.inf) - 1e-12:
                    best[other] = new
                    heapq.heappush(heap, (new, other))
    return math.nan


@given(routes(), st.tuples(st.floats(-2, 12), st.floats(-2, 12)), st.sampled_from([0.3, 1, 3, 7]),
       st.booleans(), st.booleans())  # fmt: skip
@settings(max_examples=40, deadline=None)
def test_the_least_length_in_a_region_is_that_of_a_plain_search(
    drawn, corner, size, disc, outside
):
    route, _ = drawn
    x, y = corner
    if disc:
        area = disc_area(x, y, size)

        def depth(xy):
            return size - np.hypot(xy[:, 0] - x, xy[:, 1] - y)
    else:
        area = polygon_area(shapely.box(x, y, x + size, y + size))

        def depth(xy):
            return np.minimum(
                np.minimum(xy[:, 0] - x, x + size - xy[:, 0]),
                np.minimum(xy[:, 1] - y, y + size - xy[:, 1]),
            )

    found = Reference(route, Walls(route.costmap), None).least_inside(area, outside=outside)
    wanted = least_by_dijkstra(route, depth, outside=outside)
    assert found == pytest.approx(wanted, abs=0.1 + 0.03 * wanted, nan_ok=True)


def leaves_a_way(route, away, free_around_ends, least):
    """Whether cells so far away, and all cells so near to the ends, leave a way."""
    graph, allowed = route.costmap.grid_graph, away >= least
    rows, columns = np.indices(away.shape)
    for x, y in (route.start, route.goal):
        allowed |= np.hypot(columns - x, rows - y) <= free_around_ends
    seen, stack = {route.start}, [route.start]
    while stack:
        x, y = stack.pop()
        for dx, dy in product((-1, 0, 1), repeat=2):
            other = (x + dx, y + dy)
            if other in seen or (dx, dy) == (0, 0) or not is_move(graph, (x, y), other):
                continue
            if allowed[other[1], other[0]]:
                seen.add(other)
                stack.append(other)
    return route.goal in seen


@given(routes(), st.sampled_from([0.4, 1.0, 1.7, 3.2]), st.booleans())
@settings(max_examples=60, deadline=None)
def test_the_greatest_distance_leaves_a_way_and_a_little_more_none(drawn, metres, of_walls):
    route, random = drawn
    grid_map = route.costmap.grid_map
    rows, columns = np.indices(route.costmap.blocked.shape)
    points = grid_map.grid_to_world(np.column_stack((columns.ravel(), rows.ravel())))
    box = tuple(random.uniform(0.0, 8.0, 2))
    box = (*box, box[0] + 1.5, box[1] + 2.5)
    if of_walls:
        assume(route.costmap.blocked.any())
        walls = np.argwhere(grid_map.cells > 0)[:, ::-1]
        cells = np.column_stack((columns.ravel(), rows.ravel()))
        off = np.maximum(np.abs(cells[:, None] - walls) - 0.5, 0.0)
        away = np.hypot(off[..., 0], off[..., 1]).min(axis=1)
        target = Walls(route.costmap).zone(0.0)
    else:
        away = np.maximum(-box_depth(points, *box), 0.0)
        target = polygon_area(shapely.box(*box))
    away = away.reshape(rows.shape)
    assume(leaves_a_way(route, away, metres, 0.0))
    path = polyline([grid_map.grid_to_world([cell])[0] for cell in (route.start, route.goal)])
    found = greatest_clearance(Measurement(Specification(()), path, route), target, metres)
    # The wall whose centre is nearest may be a fifth of a cell farther than the nearest.
    slack = 0.21 if of_walls else 1e-4
    assert leaves_a_way(route, away, found + 1e-4, found - slack)
    if found < metres - slack:
        assert not leaves_a_way(route, away, found, found + STEP + 1e-4)


PLACES = (
    Place('room', shapely.box(2.0, 2.0, 5.5, 6.0), 'room', (), ('blue',)),
    Place('hall', shapely.box(7.0, 5.0, 9.5, 9.0), 'room', (), ('blue',)),
    Place('rack', shapely.box(4.5, 7.0, 6.5, 8.0), 'object'),
    Place('lamp', shapely.Point(8.2, 3.1), 'object'),
    Place('sign', shapely.Point(3.3, 9.6)),
)
SIMPLE = st.one_of(
    st.sampled_from(['room', 'hall', 'rack', 'lamp', 'sign']).map(NamedPlace),
    st.sampled_from(['blue', 'object']).map(Tagged),
    st.sampled_from(['north', 'west', 'left', 'right']).map(Half),
    st.builds(Disc, st.integers(0, 12), st.integers(0, 12), st.sampled_from([0.0, 1.0, 2.5])),
    st.builds(
        lambda x, y, dx, dy: Box(x, y, x + dx, y + dy),
        st.integers(-2, 10),
        st.integers(-2, 10),
        st.sampled_from([1, 2.5, math.inf]),
        st.sampled_from([1, 2.5, math.inf]),
    ),
    st.just(Between('room', 'hall')),
    st.builds(Along, st.sampled_from(['rack', 'room', 'walls']), st.sampled_from([0.6, 1.0])),
    st.just(Half('south', 'hall')),
)
PAIRS = st.tuples(SIMPLE, SIMPLE)
REGIONS = st.one_of(
    SIMPLE, SIMPLE, SIMPLE, st.sampled_from(['start', 'goal']).map(End), PAIRS.map(AnyOf),
    PAIRS.map(AllOf), PAIRS.map(lambda pair: Except(pair[0], pair[1:])),
)  # fmt: skip
STRENGTHS = st.sampled_from(['must', SHOULD])
CLAUSES = st.one_of(
    st.builds(Avoid, STRENGTHS, region=REGIONS, margin=st.sampled_from([0.0, 1.0])),
    st.builds(lambda region: Visit(regions=(region,)), REGIONS),
    st.builds(lambda one, two: Visit(regions=(one, two)), REGIONS, REGIONS),
    st.builds(Before, first=REGIONS, second=REGIONS),
    st.builds(Then, first=REGIONS, second=REGIONS),
    st.builds(NeverAfter, first=REGIONS, second=REGIONS),
    st.builds(lambda region, least, more: Count('must', '', region, least, least + more),
              REGIONS, st.integers(0, 2), st.integers(0, 1)),
    st.builds(StayIn, STRENGTHS, region=REGIONS),
    st.builds(Pass, region=REGIONS, side=st.sampled_from(['north', 'east', 'left', 'right'])),
    st.builds(KeepDistance, STRENGTHS, metres=st.sampled_from([0.4, 1.0, 1.6]),
              region=st.one_of(st.none(), REGIONS)),
    st.builds(EndAt, region=REGIONS),
)  # fmt: skip


def random_paths(route, random, count):
    """Paths over cells between the ends of a route: plain, by detours, and on priced maps."""
    blocked, config = route.costmap.blocked, route.costmap.config
    free = np.argwhere(~blocked)[:, ::-1]
    for number in range(count):
        cost = random.integers(0, 101, blocked.shape) if number % 3 else None
        graph = GridGraph(
            blocked, corner_cutting=config.corner_cutting, cost=cost, cost_multiplier=20.0
        )
        via = random.choice(free, number % 4)
        stops = [route.start, *((int(x), int(y)) for x, y in via), route.goal]
        parts = [shortest_path(graph, a, b)[0] for a, b in pairwise(stops)]
        if all(len(part) for part in parts):
            yield np.concatenate([parts[0], *(part[1:] for part in parts[1:])])


@given(routes(PLACES), st.lists(CLAUSES, min_size=4, max_size=8))
@settings(max_examples=25, deadline=None)
def test_nothing_impossible_is_done_and_nothing_is_less_than_the_least(drawn, clauses):
    route, random = drawn
    assume(sum(len(one.regions) for one in clauses if isinstance(one, Visit)) <= 8)
    paths = [route.costmap.grid_map.grid_to_world(path) for path in random_paths(route, random, 8)]
    for clause in clauses:
        specification = Specification((clause,))
        found = [verify(specification, path, route)[0] for path in paths]
        kinds = {one.status for one in found}
        assert not {SATISFIED, IMPOSSIBLE} <= kinds, clause
        if isinstance(clause, Avoid | StayIn):
            leasts = [one.least for one in found if one.measured > 0.0 and one.least >= 0.0]
            for one in found:
                assert not leasts or one.measured >= max(leasts) - 0.15 - 0.03 * max(leasts)


@given(routes(PLACES), st.lists(CLAUSES, min_size=2, max_size=6))
@settings(max_examples=20, deadline=None)
def test_a_path_is_judged_alike_in_both_frames(drawn, clauses):
    """The same world in a frame that is turned by a right angle: the compass turns with it."""
    route, random = drawn
    paths = list(random_paths(route, random, 3))
    assume(paths and sum(len(one.regions) for one in clauses if isinstance(one, Visit)) <= 8)
    quarter = math.pi / 2
    origin = route.costmap.grid_map.origin
    x, y = turned([origin[:2]], quarter)[0]
    grid_map = GridMap(
        route.costmap.grid_map.cells, 1.0, Pose2D(float(x), float(y), origin.yaw + quarter)
    )
    places = Places(
        Place(
            one.name,
            shapely.transform(one.geometry, lambda xy: turned(xy, quarter)),
            one.kind,
            one.aliases,
            one.tags,
        )
        for one in route.places
    )
    other = Route(Costmap(grid_map, route.costmap.config), route.start, route.goal, places)
    for clause in clauses:
        if uses_coordinates(clause):
            continue
        for path in paths:
            one, two = (
                verify(Specification((clause,)), here.costmap.grid_map.grid_to_world(path), here)
                for here in (route, other)
            )
            assert one[0].status is two[0].status or near_an_edge(one[0], two[0])


def uses_coordinates(clause):
    """Whether a clause has numbers or compass words, which do not turn with the frame."""
    text = repr(clause)
    return any(word in text for word in ('Disc', 'Box', 'north', 'south', 'east', 'west'))


def near_an_edge(one, two):
    """Whether rounding may decide: what was measured differs by next to nothing."""
    return abs(np.nan_to_num(one.measured) - np.nan_to_num(two.measured)) < 0.05
