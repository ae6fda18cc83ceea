"""Rules of the road: no plan breaks one, and each is as short as a plain Dijkstra finds it.

The headings of cells, the moves that they leave and the shortest paths are computed here anew, by
shapely and in plain Python.
"""

import heapq
import math
from dataclasses import replace
from itertools import combinations, pairwise

import numpy as np
import pytest
import shapely
from llm_astar_msgs_adapter.maps.grid_map import GridMap
from llm_astar_planner.costmap.config import CostmapConfig
from llm_astar_planner.costmap.zone_layer import ZoneLayer
from llm_astar_planner.costmap.zones import KEEP_RIGHT, ONE_WAY, PREFERRED, Zone
from llm_astar_planner.instructions.clauses.visit import Visit
from llm_astar_planner.instructions.interpretation import (
    Interpretation,
    RouteInstruction,
    Understanding,
)
from llm_astar_planner.instructions.regions import Box
from llm_astar_planner.instructions.specification import Specification
from llm_astar_planner.planning.footprint import Footprint
from llm_astar_planner.planning.path_validator import invalid_poses
from llm_astar_planner.planning.plan_reuse import reuse_problem, way_of
from llm_astar_planner.planning.planner import Planner
from llm_astar_planner.planning.types import PlanRequest, ResultCode

SIZE, RESOLUTION = 20, 0.5
ACROSS = math.sin(math.radians(22.5))
STEPS = [(x, y) for x in (-1, 0, 1) for y in (-1, 0, 1) if x or y]


def composed(cells, zones, config=None):
    base = GridMap(np.asarray(cells, dtype=np.int8), RESOLUTION)
    return ZoneLayer(base, zones, config=config).compose(base)


def planner_on(cells, *zones, **rules):
    config = CostmapConfig(**rules)
    return Planner(composed(cells, zones, config), config).prepare()


def heading_of(zone, x, y):
    """Return the direction of a cell in a zone, (x, y, side), None where it has none."""
    square = shapely.box(*(RESOLUTION * np.array([x, y, x + 1, y + 1])))
    if square.intersection(zone.area).area < 1e-13:
        return None
    if not zone.is_line:
        angle = math.radians(zone.heading)
        return math.cos(angle), math.sin(angle), 0
    centre = shapely.Point(RESOLUTION * (x + 0.5), RESOLUTION * (y + 0.5))
    parts = list(pairwise(zone.geometry.coords))
    away = [shapely.LineString(part).distance(centre) for part in parts]
    number = next(n for n, distance in enumerate(away) if distance < min(away) + 1e-9)
    (ax, ay), (bx, by) = parts[number]
    length, side = math.hypot(bx - ax, by - ay), 1
    is_left = (bx - ax) * (centre.y - ay) > (by - ay) * (centre.x - ax)
    if number + 1 < len(parts) and away[number + 1] < min(away) + 1e-9:
        # At a bend all cells that are nearest to its corner lie outside of the turn.
        (_, (cx, cy)) = parts[number + 1]
        is_left = (bx - ax) * (cy - by) < (by - ay) * (cx - bx)
    if zone.kind == KEEP_RIGHT and is_left:
        side = -1
    return side * (bx - ax) / length, side * (by - ay) / length, side


class Rules:
    """Tells which moves zones allow, by the words of the documentation."""

    def __init__(self, zones, size=SIZE):
        self.fields = {
            zone.label: {(x, y): heading_of(zone, x, y) for x in range(size) for y in range(size)}
            for zone in zones
            if zone.kind in (ONE_WAY, KEEP_RIGHT)
        }

    def without(self, names):
        rules = Rules(())
        rules.fields = {name: field for name, field in self.fields.items() if name not in names}
        return rules

    def allow(self, begin, end):
        step = np.array(end) - begin
        step = step / math.hypot(*step)
        for field in self.fields.values():
            ends = [field[begin], field[end]]
            parts = [one[0] * step[0] + one[1] * step[1] for one in ends if one is not None]
            crosses = len(parts) == 2 and ends[0][2] != ends[1][2] and abs(parts[0]) <= ACROSS
            if not crosses and min(parts, default=0.0) < -1e-9:
                return False
        return True

    def allow_line(self, points):
        """Tell whether straight lines through points make allowed moves between the cells."""
        places = [points[:1]]
        for begin, end in pairwise(np.asarray(points, dtype=float)):
            # Parts that meet no corner of cells exactly.
            count = 1 + int(40 * math.hypot(*(end - begin)))
            parts = (np.arange(count) + 0.3718) / count
            places.append(begin + parts[:, None] * (end - begin))
        cells = np.floor(np.concatenate([*places, points[-1:]]) + 0.5).astype(int).tolist()
        return all(
            self.allow(tuple(begin), tuple(end)) for begin, end in pairwise(cells) if begin != end
        )


def moves_from(cells, rules, corner_cutting=False):
    """Return the legal moves of each free cell and their lengths."""
    free = {(int(x), int(y)) for y, x in np.argwhere(np.asarray(cells) < 65)}
    moves = {}
    for x, y in free:
        around = [((x + dx, y + dy), math.hypot(dx, dy)) for dx, dy in STEPS]
        moves[x, y] = [
            (cell, length)
            for cell, length in around
            if cell in free
            and (corner_cutting or ((x, cell[1]) in free and (cell[0], y) in free))
            and rules.allow((x, y), cell)
        ]
    return moves


def dijkstra(moves, start, price):
    """Return the least cost of each cell that is reached from the start."""
    costs, queue = {}, [(0.0, start)]
    while queue:
        cost, cell = heapq.heappop(queue)
        if cell in costs:
            continue
        costs[cell] = cost
        for other, length in moves[cell]:
            if other not in costs:
                paid = length * (1.0 + (price[cell] + price[other]) / 2.0)
                heapq.heappush(queue, (cost + paid, other))
    return costs


def random_zones(random):
    side = SIZE * RESOLUTION
    zones = []
    for number in range(random.integers(1, 4)):
        kind = random.choice([ONE_WAY, ONE_WAY, KEEP_RIGHT])
        angle = random.choice([90.0 * random.integers(4), random.uniform(0.0, 360.0)])
        x, y = random.uniform(0.0, side, 2)
        width, height = random.uniform(1.0, side, 2)
        polygon = shapely.box(x - width / 2, y - height / 2, x + width / 2, y + height / 2)
        line = shapely.LineString(random.uniform(0.0, side, (random.integers(2, 5), 2)))
        if kind == ONE_WAY and random.random() < 0.6:
            zones.append(Zone(str(number), polygon, 0, kind=kind, heading=angle))
        else:
            lane = random.uniform(1.0, 4.0)
            zones.append(Zone(str(number), line, 0, kind=kind, width=lane))
    return zones


def random_problem(random, graded):
    """Return a planner on a random map with rules, the legal moves, and the price of cells."""
    cells = np.where(random.random((SIZE, SIZE)) < random.choice([0.0, 0.1, 0.25]), 100, 0)
    zones, prices = random_zones(random), np.zeros((SIZE, SIZE))
    if graded:
        road = shapely.LineString(random.uniform(0.0, SIZE * RESOLUTION, (3, 2)))
        zones.append(Zone('road', road, 50, kind=PREFERRED, width=1.0))
        x, y = np.meshgrid(np.arange(SIZE), np.arange(SIZE))
        squares = shapely.box(*(RESOLUTION * np.array([x, y, x + 1, y + 1])))
        off = shapely.area(shapely.intersection(squares, road.buffer(0.5))) < 1e-13
        prices[off] = 1.0
    rules, cutting = Rules(zones), bool(random.random() < 0.2)
    price = {(x, y): prices[y, x] for x in range(SIZE) for y in range(SIZE)}
    planner = planner_on(cells, *zones, corner_cutting=cutting)
    return planner, rules, moves_from(cells, rules, cutting), price


def best_cost(moves, stops, price):
    """Return the least cost of a path through stops in turn, infinity without one."""
    return sum(dijkstra(moves, begin, price).get(end, math.inf) for begin, end in pairwise(stops))


def check(planner, rules, moves, price, request):
    """Hold a plan against the moves and a Dijkstra of its own; return whether it is a path."""
    plan = planner.plan(request)
    stops = [request.start, *request.via, request.goal]
    best = best_cost(moves, stops, price)
    if request.footprint is None and math.isinf(best):
        assert plan.code is ResultCode.NO_VALID_PATH
        check_why(planner, rules, price, plan.why, stops)
    if plan.code is not ResultCode.NONE:
        assert request.footprint is not None or math.isinf(best), plan.message
        return False
    path = [tuple(cell) for cell in plan.path.tolist()]
    assert all(end in dict(moves[begin]) for begin, end in pairwise(path))
    for points in (plan.smoothed, None if plan.any_angle is None else plan.any_angle.points):
        assert points is None or rules.allow_line(points)
    if request.footprint is None:
        if not any(price.values()):
            assert plan.cost == pytest.approx(best, rel=1e-6)
        assert plan.cost / plan.suboptimality_bound <= best * (1.0 + 1e-6)
        assert best * (1.0 - 1e-6) <= plan.cost <= best * 1.01
    return True


def check_why(planner, rules, price, why, stops):
    """Tell by Dijkstra that without the rules that are named there is a path, if any is."""
    named = {cause['name'] for cause in why.causes if cause['kind'] in (ONE_WAY, KEEP_RIGHT)}
    cells, cutting = planner.grid_map.cells, planner.config.corner_cutting
    ends = stops[why.reached : why.reached + 2]

    def cost_without(names):
        return best_cost(moves_from(cells, rules.without(names), cutting), ends, price)

    opens = math.isfinite(cost_without(rules.fields))
    assert (named != set()) is opens
    if opens:
        assert math.isfinite(cost_without(named))
        fewer = [{*names} for n in range(len(named)) for names in combinations(rules.fields, n)]
        assert all(math.isinf(cost_without(names)) for names in fewer)


def random_request(random, free):
    """Return a request between free cells, some with via points, a footprint or other angles."""
    start, goal, via = (free[index] for index in random.integers(0, len(free), 3))
    footprint = Footprint(((0.4, 0.2), (0.4, -0.2), (-0.4, -0.2), (-0.4, 0.2)))
    return PlanRequest(
        start, goal, str(random.choice(['guided', 'exact_astar'])), max_suboptimality=1.0,
        any_angle=bool(random.random() < 0.4), smoothing=bool(random.random() < 0.3),
        via=(via,) if random.random() < 0.2 else (), time_limit=60.0,
        footprint=footprint if random.random() < 0.1 else None,
    )  # fmt: skip


def random_plans(seed, maps, plans):
    """Check random plans; return how many there were, and how many had a path."""
    random, count, found = np.random.default_rng(seed), 0, 0
    for number in range(maps):
        planner, *problem = random_problem(random, graded=number % 3 == 2)
        free = sorted(problem[1])
        for _ in range(plans):
            found += check(planner, *problem, random_request(random, free))
            count += 1
    return count, found


def test_no_random_plan_breaks_a_rule_and_each_is_as_short_as_dijkstra_finds_it():
    count, found = random_plans(seed=1, maps=15, plans=8)
    assert count == 120
    assert found > 60


def test_far_goals_need_no_jump_points_and_landmarks_are_measured_without_rules():
    size, random = 90, np.random.default_rng(3)
    cells = np.where(random.random((size, size)) < 0.1, 100, 0)
    side = size * RESOLUTION
    zones = [
        Zone('west', shapely.box(0.0, 10.0, side, 14.0), 0, kind=ONE_WAY, heading=180.0),
        Zone('east', shapely.box(0.0, 30.0, side, 34.0), 0, kind=ONE_WAY, heading=0.0),
    ]
    rules, planner = Rules(zones, size), planner_on(cells, *zones)
    with planner.landmarks.lend(planner.costmap.grid_graph) as landmarks:
        assert landmarks is not None
        assert landmarks.is_admissible_on(planner.costmap.grid_graph.without_rules)
    moves = moves_from(cells, rules)
    price = dict.fromkeys(moves, 0.0)
    free = sorted(moves)
    for start, goal in zip(free[:60:15], free[-1:-60:-15]):
        for begin, end in ((start, goal), (goal, start)):
            assert check(planner, rules, moves, price, PlanRequest(begin, end))


# A wall with two doors; the lower one is a one-way to the right.
WALL = np.zeros((SIZE, SIZE), dtype=np.int8)
WALL[:, 10], WALL[4:7, 10], WALL[14:17, 10] = 100, 0, 0
DOOR = Zone('in', shapely.box(4.6, 1.6, 5.9, 3.6), 0, 'entry', kind=ONE_WAY, heading=0.0)
LEFT, RIGHT = (3, 5), (17, 5)


def test_a_one_way_is_driven_along_and_not_against():
    planner = planner_on(WALL, DOOR)
    there, back = planner.plan(PlanRequest(LEFT, RIGHT)), planner.plan(PlanRequest(RIGHT, LEFT))
    assert there.length == 14.0
    assert back.length > 24.0
    assert (back.path[back.path[:, 0] == 10][:, 1] > 10).all()


def test_a_one_way_that_closes_the_only_way_is_named_with_the_length_without_it():
    cells = WALL.copy()
    cells[14:17, 10] = 100
    plan = planner_on(cells, DOOR).plan(PlanRequest(RIGHT, LEFT))
    assert plan.code is ResultCode.NO_VALID_PATH
    assert plan.why.causes[0]['kind'] == ONE_WAY
    assert plan.why.length == 7.0
    assert 'rules of the road cut the goal' in plan.message
    assert 'the one-way in (entry) closes the way, of 7.00 m without it' in plan.message
    nearest = planner_on(cells, DOOR).plan(replace(PlanRequest(RIGHT, LEFT), tolerance=5.0))
    assert nearest.code is ResultCode.NONE
    assert nearest.goal[0] >= 10


def test_of_a_rule_and_a_keepout_zone_on_one_way_both_are_named():
    cells = WALL.copy()
    cells[14:17, 10] = 100
    keepout = Zone('spill', shapely.box(6.6, 0.0, 7.4, 10.0))
    plan = planner_on(cells, DOOR, keepout).plan(PlanRequest(RIGHT, LEFT))
    assert {cause['kind'] for cause in plan.why.causes} == {'zone', ONE_WAY}
    assert plan.why.length == 7.0


def test_the_last_check_refuses_what_goes_against_a_rule():
    planner = planner_on(WALL, DOOR)
    path = np.array([(x, 5) for x in range(17, 2, -1)], dtype=np.int32)
    problem = planner.checker.path_problem(path, RIGHT, LEFT)
    assert problem == 'it goes against a rule of the road at (12, 5)'
    assert planner.checker.path_problem(path[::-1], LEFT, RIGHT) is None
    assert 'against a rule' in planner.checker.segments_problem(np.array([RIGHT, LEFT]))
    assert planner.checker.segments_problem(np.array([LEFT, RIGHT])) is None
    assert invalid_poses(np.array([RIGHT, LEFT]), planner.checker).tolist() == [False, True]
    assert not invalid_poses(np.array([LEFT, RIGHT]), planner.checker).any()


def test_a_method_that_knows_no_rules_is_withheld_where_it_breaks_one():
    plan = planner_on(WALL, DOOR).plan(PlanRequest(RIGHT, LEFT, 'astar'))
    assert plan.code is ResultCode.UNKNOWN
    assert 'withheld: it goes against a rule of the road' in plan.message
    assert planner_on(WALL, DOOR).plan(PlanRequest(LEFT, RIGHT, 'astar')).code is ResultCode.NONE


def test_in_a_lane_one_keeps_right():
    line = shapely.LineString([(0.0, 5.0), (10.0, 5.0)])
    walls = np.full((SIZE, SIZE), 100)
    walls[6:14] = 0
    planner = planner_on(walls, Zone('hall', line, 0, kind=KEEP_RIGHT, width=4.0))
    for start, goal, is_right in (((1, 9), (18, 9), True), ((18, 10), (1, 10), False)):
        plan = planner.plan(PlanRequest(start, goal, any_angle=True, smoothing=True))
        assert ((plan.path[:, 1] < 10) == is_right).all()
        assert len(plan.any_angle.points) == 2
    crossing = planner.plan(PlanRequest((3, 7), (3, 12)))
    assert crossing.length == 5.0


def test_off_the_preferred_lines_cells_cost_more():
    line = shapely.LineString([(1.0, 8.0), (9.0, 8.0)])
    lane = Zone('road', line, 50, kind=PREFERRED, width=0.4)
    planner = planner_on(np.zeros((SIZE, SIZE)), lane)
    plan = planner.plan(PlanRequest((1, 14), (18, 14)))
    assert np.isin(plan.path[3:-3, 1], (15, 16)).all()
    strict = planner_on(np.zeros((SIZE, SIZE)), replace(lane, cost=100))
    assert (strict.costmap.blocked.sum()) > 350
    assert strict.plan(PlanRequest((3, 15), (16, 15))).length == 13.0


def test_a_kept_way_is_given_up_where_a_rule_comes_to_forbid_it():
    free = planner_on(WALL)
    request = PlanRequest(RIGHT, LEFT, switch_margin=0.05)
    first = free.plan(request)
    way = way_of(first, free.costmap)
    again = free.plan(replace(request, last_path=way))
    assert 'kept' in again.message
    ruled = planner_on(WALL, DOOR)
    changed = ruled.plan(replace(request, last_path=way))
    assert 'changed: it goes against a rule of the road' in changed.message
    assert (changed.path[changed.path[:, 0] == 10][:, 1] > 10).all()
    assert 'against a rule' in reuse_problem(first, free.grid_map, ruled)


def test_instructions_and_alternatives_keep_the_rules():
    planner = planner_on(WALL, DOOR)
    moves = moves_from(WALL, Rules([DOOR]))
    clause = Visit(regions=(Box(1.0, 1.0, 2.0, 2.0),))
    reading = Interpretation('a', Specification((clause,)), 'test', Understanding.WHOLE)
    request = PlanRequest(RIGHT, (17, 8), instruction=RouteInstruction(reading), time_limit=60.0)
    visiting = planner.plan(request)
    assert visiting.instruction.satisfied
    several = planner.plan(PlanRequest(RIGHT, LEFT, alternatives=2))
    for path in (visiting.path, *(way.path for way in several.alternatives)):
        cells = [tuple(cell) for cell in path.tolist()]
        assert len(cells) > 20
        assert all(end in dict(moves[begin]) for begin, end in pairwise(cells))


def test_maps_with_other_rules_are_other_maps():
    free, ruled = composed(WALL, []), composed(WALL, [DOOR])
    assert free.digest != ruled.digest
    assert not free.is_equal_to(ruled)
    assert ruled.is_equal_to(composed(WALL, [DOOR]))
    before = Planner(free).prepare()
    after = Planner(ruled, previous=before).prepare()
    assert np.array_equal(
        after.costmap.grid_graph.moves, planner_on(WALL, DOOR).costmap.grid_graph.moves
    )
    assert not Planner(free, previous=after).prepare().costmap.grid_graph.has_rules
