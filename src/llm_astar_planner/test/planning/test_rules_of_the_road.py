"""Rules of the road: no plan breaks one, and each is as short as a plain Dijkstra finds it.

The headings of cells, the moves that they leave and the shortest paths are computed here anew, by
shapely and in plain Python.
"""

import heapq
import math
from itertools import combinations, pairwise

import numpy as np
import pytest
import shapely
from llm_astar_msgs_adapter.maps.grid_map import GridMap
from llm_astar_planner.costmap.config import CostmapConfig
from llm_astar_planner.costmap.zone_layer import ZoneLayer
from llm_astar_planner.costmap.zones import KEEP_RIGHT, ONE_WAY, PREFERRED, Zone
from llm_astar_planner.planning.footprint import Footprint
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

    def __init__(self, zones):
        self.fields = {
            zone.label: {(x, y): heading_of(zone, x, y) for x in range(SIZE) for y in range(SIZE)}
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
    free = {(x, y) for x in range(SIZE) for y in range(SIZE) if cells[y][x] < 65}
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
    count, found = random_plans(seed=1, maps=15, plans=20)
    assert count == 300
    assert found > 150
