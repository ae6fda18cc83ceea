"""A planner that keeps another instruction than the one given is caught by the check.

For each instruction the path is planned with one of its clauses left out, weakened, turned round
or moved. Whether that path keeps the clause is judged here from points a centimetre apart, by
arithmetic on boxes and circles: the check must not say that it is kept where it is not.
"""

import math
from dataclasses import replace
from itertools import permutations

import numpy as np
import pytest
import shapely
from llm_astar_msgs_adapter.maps.grid_map import GridMap
from llm_astar_msgs_adapter.maps.places import Place, Places
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
from llm_astar_planner.instructions.interpretation import Interpretation, RouteInstruction
from llm_astar_planner.instructions.outcome import ClauseStatus
from llm_astar_planner.instructions.regions import (
    AllOf,
    AnyOf,
    Box,
    Disc,
    End,
    Except,
    Half,
    NamedPlace,
    Tagged,
)
from llm_astar_planner.instructions.route import Route
from llm_astar_planner.instructions.specification import NOTHING_ASKED, Specification
from llm_astar_planner.instructions.verification.verify import verify
from llm_astar_planner.planning.compile import compile_instruction_kernels
from llm_astar_planner.planning.planner import Planner
from llm_astar_planner.planning.types import PlanRequest
from path_samples import box_depth, dense, disc_depth, length_where

# 24 m x 18 m in cells of 0.25 m: three rooms in the south, three in the north, a hall between,
# and a table in the hall.
CELL = 0.25
SIZE = (24.0, 18.0)
ROOMS = {
    'office': (0.0, 0.0, 8.0, 7.0),
    'store': (8.0, 0.0, 16.0, 7.0),
    'dock': (16.0, 0.0, 24.0, 7.0),
    'shop': (0.0, 11.0, 8.0, 18.0),
    'kitchen': (8.0, 11.0, 16.0, 18.0),
    'lab': (16.0, 11.0, 24.0, 18.0),
    'hall': (0.0, 7.0, 24.0, 11.0),
}
TABLE = (11.0, 8.5, 13.0, 9.5)
TAGS = {'blue': ('store', 'kitchen')}
HELD = (ClauseStatus.KEPT, ClauseStatus.AS_FAR_AS_POSSIBLE)
START, GOAL = (2.125, 2.125), (21.875, 15.875)


def cells():
    grid = np.zeros((72, 96), np.int8)
    for x in (8.0, 16.0):
        grid[:28, int(x / CELL)] = grid[44:, int(x / CELL)] = 100
    for y in (7.0, 10.75):
        grid[int(y / CELL)] = 100
        for door in (3.0, 12.0, 20.0):
            grid[int(y / CELL), int(door / CELL) : int(door / CELL) + 6] = 0
    grid[12:18, 32] = grid[12:18, 64] = grid[56:62, 32] = grid[56:62, 64] = 0
    x0, y0, x1, y1 = (int(side / CELL) for side in TABLE)
    grid[y0:y1, x0:x1] = 100
    return grid


GRID = cells()
PLACES = Places([
    *(
        Place(name, shapely.box(*box), 'room', (), tuple(t for t in TAGS if name in TAGS[t]))
        for name, box in ROOMS.items()
    ),
    Place('table', shapely.box(*TABLE), 'object'),
])  # fmt: skip
OFFICE, STORE, DOCK, SHOP, KITCHEN, LAB, HALL, TABLES = map(
    NamedPlace, ('office', 'store', 'dock', 'shop', 'kitchen', 'lab', 'hall', 'table')
)

INSTRUCTIONS = [
    (Avoid(region=HALL, margin=0.0, strength=SHOULD),),
    (Avoid(region=KITCHEN),),
    (Avoid(region=Disc(3.75, 7.0, 1.5)),),
    (Avoid(region=Disc(12.0, 9.0, 0.5), margin=1.0),),
    (Avoid(region=Tagged('blue')),),
    (Avoid(region=Box(-math.inf, 9.5, 14.0, math.inf)),),
    (Avoid(region=STORE), Avoid(region=LAB, margin=-0.0, strength=SHOULD)),
    (Visit(regions=(DOCK,)),),
    (Visit(regions=(SHOP,)), Visit(regions=(DOCK,))),
    (Visit(regions=(DOCK,)), Visit(regions=(SHOP,)), Visit(regions=(STORE,))),
    (Visit(regions=(DOCK, SHOP, KITCHEN)),),
    (Visit(regions=(Disc(22.0, 1.0),)), Visit(regions=(Disc(1.0, 17.0, 1.0),))),
    (Visit(regions=(TABLES,)),),
    (Visit(regions=(Tagged('blue'),)),),
    (Visit(regions=(SHOP,)), Avoid(region=KITCHEN)),
    (Visit(regions=(DOCK, SHOP)), Visit(regions=(KITCHEN,)), Avoid(region=STORE)),
    (Before(first=DOCK, second=HALL),),
    (Before(first=SHOP, second=LAB), Visit(regions=(LAB,))),
    (Before(first=Disc(20.0, 2.0, 1.0), second=LAB),),
    (StayIn(region=Half('south'), strength=SHOULD),),
    (StayIn(region=Half('west'), strength=SHOULD),),
    (StayIn(region=Box(1.0, 1.0, 23.0, 17.0)), Visit(regions=(SHOP,))),
    (StayIn(region=Box(-math.inf, -math.inf, 14.0, math.inf), strength=SHOULD),),
    (StayIn(region=HALL, strength=SHOULD),),
    (Pass(region=TABLES, side='north'),),
    (Pass(region=TABLES, side='south'),),
    (Pass(region=KITCHEN, side='south'),),
    (Pass(region=TABLES, side='left'), Avoid(region=STORE)),
    (Pass(region=TABLES, side='right'), Avoid(region=KITCHEN)),
    (KeepDistance(metres=0.6),),
    (KeepDistance(metres=1.0, strength=SHOULD),),
    (KeepDistance(metres=3.5, region=KITCHEN),),
    (KeepDistance(metres=1.25, region=TABLES), Pass(region=TABLES, side='north')),
    (KeepDistance(metres=5.0, region=Disc(12.0, 3.0)), Visit(regions=(KITCHEN,))),
    (EndAt(region=KITCHEN),),
    (EndAt(region=Disc(22.0, 1.0, 0.5)), Avoid(region=HALL)),
    (EndAt(region=SHOP), Visit(regions=(LAB,))),
    (EndAt(region=TABLES), Avoid(region=STORE)),
    (Then(first=HALL, second=KITCHEN),),
    (Visit(regions=(SHOP,)), Then(first=SHOP, second=DOCK)),
    (Then(first=STORE, second=SHOP), Visit(regions=(STORE,)), Avoid(region=KITCHEN)),
    (Visit(regions=(DOCK,)), NeverAfter(first=HALL, second=DOCK)),
    (Visit(regions=(KITCHEN, STORE)), NeverAfter(first=KITCHEN, second=HALL)),
    (NeverAfter(first=Disc(3.75, 7.0, 1.5), second=LAB),),
    (Count(region=HALL, at_least=2),),
    (Count(region=KITCHEN, at_least=1, at_most=1), Visit(regions=(SHOP,))),
    (Count(region=HALL, at_most=1), Visit(regions=(DOCK,)), Visit(regions=(KITCHEN,))),
    (Count(region=DOCK, at_least=2, at_most=2),),
    (Count(region=TABLES, at_least=1), Avoid(region=STORE)),
    (Visit(regions=(AnyOf((DOCK, SHOP)),)),),
    (Avoid(region=AnyOf((STORE, KITCHEN))),),
    (Visit(regions=(Except(Tagged('blue'), (STORE,)),)),),
    (Avoid(region=Except(HALL, (Box(16.0, -math.inf, math.inf, math.inf),))),),
    (Visit(regions=(AllOf((HALL, Half('west'))),)), Avoid(region=AllOf((HALL, Half('east'))))),
    (Visit(regions=(End('goal'),)), EndAt(region=End('start'))),
]


@pytest.fixture(scope='module')
def planner():
    compile_instruction_kernels()  # else a slow compilation counts as planning time
    return Planner(GridMap(GRID, CELL)).prepare()


def planned(planner, specification):
    """The points of the path that is planned with a specification."""
    start, goal = (planner.grid_map.world_to_cell(*point) for point in (START, GOAL))
    instruction = RouteInstruction(Interpretation('', specification), PLACES)
    made = planner.plan(PlanRequest(start, goal, instruction=instruction))
    return planner.grid_map.grid_to_world(made.path)


def verified(planner, specification, points):
    """What the check says of a path."""
    start, goal = (planner.grid_map.world_to_cell(*point) for point in (START, GOAL))
    return verify(specification, points, Route(planner.costmap, start, goal, PLACES))


def mutants(specification):
    """Specifications that a planner with a mistake may keep to instead."""
    clauses = specification.clauses
    yield NOTHING_ASKED
    for index, clause in enumerate(clauses):
        others = clauses[:index] + clauses[index + 1 :]
        yield Specification(others)
        for wrong in misread(clause):
            yield Specification((*clauses[:index], wrong, *clauses[index + 1 :]))
    for order in permutations(clauses):
        if len(clauses) < 4 and order != clauses:
            yield Specification(order)


def misread(clause):
    """A clause as a planner with a mistake may take it."""
    opposite = {'north': 'south', 'south': 'north', 'east': 'west', 'west': 'east',
                'left': 'right', 'right': 'left'}  # fmt: skip
    match clause:
        case Avoid(region=Disc(x, y, radius)):
            yield replace(clause, region=Disc(x, y, radius / 2), margin=0.0)
            yield replace(clause, region=Disc(y, x, radius))
        case Avoid(region=Tagged()):
            yield replace(clause, region=STORE)
        case Avoid(region=region):
            yield Visit(regions=(region,))
        case Visit(regions=regions) if len(regions) > 1:
            yield replace(clause, regions=regions[:-1])
        case Visit(regions=(region,)):
            yield Avoid(region=region)
        case Before(first=first, second=second) | Then(first=first, second=second):
            yield replace(clause, first=second, second=first)
        case NeverAfter(first=first, second=second):
            yield replace(clause, first=second, second=first)
            yield Before(first=first, second=second)
        case Count(at_least=at_least, at_most=at_most):
            yield replace(clause, at_least=max(0, at_least - 1))
            yield replace(clause, at_most=None if at_most is None else at_most + 1)
        case StayIn(region=Half(side)):
            yield replace(clause, region=Half(opposite[side]))
        case StayIn(region=region):
            yield Avoid(region=region)
        case Pass(side=side):
            yield replace(clause, side=opposite[side])
        case KeepDistance(metres=metres):
            yield replace(clause, metres=0.8 * metres)
        case EndAt():
            yield replace(clause, region=OFFICE)


def depth_in(region, xy):
    """How deep points lie in a region; below 0 outside."""
    match region:
        case NamedPlace('table'):
            return box_depth(xy, *TABLE)
        case NamedPlace(name):
            return box_depth(xy, *ROOMS[name])
        case Tagged(tag):
            return np.max([box_depth(xy, *ROOMS[name]) for name in TAGS[tag]], axis=0)
        case Disc(x, y, radius):
            return disc_depth(xy, x, y, radius or 0.5)
        case Box(x0, y0, x1, y1):
            return box_depth(xy, max(x0, -99), max(y0, -99), min(x1, 99), min(y1, 99))
        case Half(side):
            x, y = SIZE[0] / 2 - xy[:, 0], SIZE[1] / 2 - xy[:, 1]
            return {'west': x, 'east': -x, 'south': y, 'north': -y}[side]
        case AnyOf(regions):
            return np.max([depth_in(one, xy) for one in regions], axis=0)
        case AllOf(regions):
            return np.min([depth_in(one, xy) for one in regions], axis=0)
        case Except(inner, others):
            return np.min([depth_in(inner, xy), *(-depth_in(one, xy) for one in others)], axis=0)
        case End(end):
            return disc_depth(xy, *(START if end == 'start' else GOAL), 0.5)
    raise TypeError(region)


def visit_places(region, xy, slack):
    """The numbers of the points at which a region counts as visited."""
    areas = dict.fromkeys((NamedPlace, Tagged, AnyOf, AllOf, Except), 0.5)
    needed = {**areas, Disc: -CELL}.get(type(region), 0.0)
    needed = -1.0 if region == TABLES else needed
    return np.flatnonzero(depth_in(region, xy) >= needed - slack)


def surely_broken(specification, index, points, best):
    """Whether a path breaks a clause for sure, by 5 cm; `best` is the path of the right plan."""
    clause = specification.clauses[index]
    xy, at = dense(points)
    match clause:
        case Avoid(region=region, margin=margin):
            broken = length_where(depth_in(region, xy) + margin, at)
            return broken > 0.05 + allowed(clause, margin, best)
        case StayIn(region=region):
            broken = length_where(-depth_in(region, xy), at)
            return broken > 0.05 + 1.05 * length_where(-depth_in(region, best[0]), best[1]) + CELL
        case Visit():
            return not visited_in_turn(specification, index, xy)
        case Before(first=first, second=second):
            entries = np.flatnonzero(depth_in(second, xy) > 0.02)
            visits = visit_places(first, xy, 0.05)
            return len(entries) > 0 and (not len(visits) or visits[0] > entries[0] + 5)
        case Then(first=first, second=second):
            entries = np.flatnonzero(depth_in(first, xy) > 0.02)
            visits = visit_places(second, xy, 0.05)
            return len(entries) > 0 and (not len(visits) or visits[-1] < entries[-1] - 5)
        case NeverAfter(first=first, second=second):
            entries = np.flatnonzero(depth_in(first, xy) > 0.02)
            later = np.flatnonzero(depth_in(second, xy) > 0.02)
            return len(entries) > 0 and len(later) > 0 and later[-1] > entries[0] + 5
        case Count(region=region, at_least=at_least, at_most=at_most):
            if entries_of(region, xy, 0.05) < at_least:
                return True
            return at_most is not None and entries_of(region, xy, -0.05) > at_most
        case Pass(region=region, side=side):
            return surely_not_passed(region, side, xy)
        case KeepDistance(metres=metres, region=None):
            return wall_distance(xy).min() < metres - 0.1 and clause.strength != SHOULD
        case KeepDistance(metres=metres, region=region):
            return (-depth_in(region, xy)).min() < metres - 0.15
        case EndAt(region=region):
            return not len(visit_places(region, xy[-1:], 0.55 if region != TABLES else 0.05))
    raise TypeError(clause)


def entries_of(region, xy, slack):
    """How often a path comes to a region after it was a cell and a half away from it."""
    deep = visit_places(region, xy, slack)
    reach = -1.0 if region == TABLES else 0.0
    outside = np.flatnonzero(depth_in(region, xy) < reach - 1.5 * CELL - slack)
    return len(np.unique(np.searchsorted(outside, deep)))


def allowed(clause, margin, best):
    """The metres of a path in a region that the right plan needs, and what may come on top."""
    if clause.strength != SHOULD:
        return 0.0
    needed = length_where(depth_in(clause.region, best[0]) + margin, best[1])
    return 1.05 * needed + CELL if needed else 0.0


def visited_in_turn(specification, index, xy):
    """Whether the regions of a visit clause may have been visited in their turn."""
    turn = 0
    for number, clause in enumerate(specification.clauses[: index + 1]):
        if isinstance(clause, Visit):
            ahead = [
                places[places >= turn - 5]
                for places in (visit_places(region, xy, 0.05) for region in clause.regions)
            ]
            if number == index:
                return all(len(places) for places in ahead)
            turn = max([turn, *(places[0] for places in ahead if len(places))])
    raise ValueError(index)


def surely_not_passed(region, side, xy):
    """Whether a path crosses an object, or not the ray to the side, or that to the other."""
    way = np.subtract(GOAL, START) / math.dist(GOAL, START)
    ahead = {'north': (0, 1), 'south': (0, -1), 'left': (-way[1], way[0])}
    ahead['right'] = (way[1], -way[0])
    x0, y0, x1, y1 = TABLE if region == TABLES else ROOMS[region.place]
    off = xy - ((x0 + x1) / 2, (y0 + y1) / 2)
    across = ahead[side][0] * off[:, 1] - ahead[side][1] * off[:, 0]
    along = (off @ ahead[side])[1:][np.diff(np.sign(across)) != 0.0]
    through = box_depth(xy, x0, y0, x1, y1).max() > 0.05
    return through or not (along > -0.05).any() or bool((along < -0.05).any())


def wall_distance(xy):
    """Metres from points to the squares of the occupied cells."""
    rows, columns = np.nonzero(GRID)
    boxes = np.column_stack((columns, rows)) * CELL
    nearest = np.full(len(xy), np.inf)
    for x, y in boxes:
        nearest = np.minimum(nearest, -box_depth(xy, x, y, x + CELL, y + CELL))
    return nearest


@pytest.mark.parametrize(
    'clauses', INSTRUCTIONS, ids=[Specification(c).sentence for c in INSTRUCTIONS]
)
def test_who_keeps_another_instruction_is_caught(planner, clauses):
    right = Specification(clauses)
    points = planned(planner, right)
    best = dense(points)
    for index, found in enumerate(verified(planner, right, points)):
        assert found.status in HELD, found.detail
        assert not surely_broken(right, index, points, best)
    caught = 0
    for wrong in mutants(right):
        other = planned(planner, wrong)
        for index, found in enumerate(verified(planner, right, other)):
            if surely_broken(right, index, other, best):
                caught += 1
                assert found.status not in HELD, (found, wrong)
    assert caught or not any(
        surely_broken(right, index, planned(planner, NOTHING_ASKED), best)
        for index in range(len(clauses))
    )
