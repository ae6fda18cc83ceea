"""Random paths, measured by the check and by looking at every centimetre of them."""

import math
from itertools import pairwise, permutations, product

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st
from llm_astar_msgs_adapter.maps.grid_map import Pose2D
from llm_astar_msgs_adapter.maps.places import Place, Places
from llm_astar_planner.instructions.clauses.avoid import Avoid
from llm_astar_planner.instructions.clauses.before import Before
from llm_astar_planner.instructions.clauses.clause import SHOULD
from llm_astar_planner.instructions.clauses.end_at import EndAt
from llm_astar_planner.instructions.clauses.keep_distance import KeepDistance
from llm_astar_planner.instructions.clauses.pass_by import Pass
from llm_astar_planner.instructions.clauses.stay_in import StayIn
from llm_astar_planner.instructions.clauses.visit import Visit
from llm_astar_planner.instructions.regions import Along, Box, Disc, Half, NamedPlace
from llm_astar_planner.instructions.specification import Specification
from llm_astar_planner.instructions.verification.verify import verify
from path_samples import STEP, box_depth, dense, disc_depth, length_where, triangle_depth
from verified_maps import SATISFIED, VIOLATED, field, outcome, outcomes, route, turned

SIZE = 20.0
# A path that is no deeper in a region than this is said to run along its edge.
EDGE = 1.1e-6


# Multiples of a quarter metre meet edges, corners and circles exactly; others pass them anyhow.
QUARTERS = st.integers(4, 76).map(lambda quarters: quarters / 4.0)
ANYWHERE = st.floats(1.0, 19.0)
COORDINATE = st.one_of(QUARTERS, QUARTERS, ANYWHERE)
PATHS = st.lists(st.tuples(COORDINATE, COORDINATE), min_size=1, max_size=8)
SIDE = st.sampled_from([0.25, 0.5, 1.0, 2.5, 6.0])


@st.composite
def regions(draw):
    """A region, the places it needs, and how deep points lie in it."""
    kind = draw(st.sampled_from(['place', 'box', 'open box', 'disc', 'triangle', 'half', 'along']))
    x, y, width, height = draw(COORDINATE), draw(COORDINATE), draw(SIDE), draw(SIDE)
    box = (x, y, x + width, y + height)
    place = Places([Place('it', shapely.box(*box))])
    if kind == 'place':
        return NamedPlace('it'), place, lambda xy: box_depth(xy, *box)
    if kind == 'box':
        return Box(*box), Places(), lambda xy: box_depth(xy, *box)
    if kind == 'open box':
        return Box(-math.inf, y, math.inf, math.inf), Places(), lambda xy: xy[:, 1] - y
    if kind == 'disc':
        return Disc(x, y, width), Places(), lambda xy: disc_depth(xy, x, y, width)
    if kind == 'half':
        return Half('west'), Places(), lambda xy: 10.0 - xy[:, 0]
    if kind == 'along':
        return (
            Along('it', 0.5),
            place,
            lambda xy: np.minimum(0.5 + box_depth(xy, *box), -box_depth(xy, *box)),
        )
    corners = [(x, y), (x + width, y), (x, y + height)]
    return (
        NamedPlace('it'),
        Places([Place('it', shapely.Polygon(corners))]),
        lambda xy: triangle_depth(xy, corners),
    )


@given(PATHS, regions(), st.sampled_from([0.0, 0.5, 1.25]))
@settings(max_examples=80, deadline=None)
def test_avoid_agrees_with_every_centimetre(points, region, margin):
    where, places, depth = region
    if isinstance(where, Along) or (len(places) and margin and depth_is_no_distance(places)):
        margin = 0.0
    found = outcome(points, Avoid(region=where, margin=margin), places=places)
    xy, at = dense(points)
    deep = depth(xy) + margin
    inside = ((deep[1:] > EDGE) & (deep[:-1] > EDGE)) @ np.diff(at)
    ends = max(deep[0], deep[-1])
    if found.status is SATISFIED and ends <= 0.0:
        assert deep.max() <= EDGE
    if deep.max() <= 0.0:
        assert found.status is SATISFIED
    if inside > 0.05:
        assert found.measured == pytest.approx(inside, abs=0.1 + 0.01 * inside)


def depth_is_no_distance(places):
    """Whether the depth in a place is not its distance outside of it."""
    return len(next(iter(places)).geometry.exterior.coords) == 4


@given(PATHS, regions())
@settings(max_examples=50, deadline=None)
def test_stay_in_agrees_with_every_centimetre(points, region):
    where, places, depth = region
    found = outcome(points, StayIn(region=where), places=places)
    xy, at = dense(points)
    deep = depth(xy)
    outside = ((deep[1:] < -EDGE) & (deep[:-1] < -EDGE)) @ np.diff(at)
    if deep.min() < -0.02 and min(deep[0], deep[-1]) > 0.01:
        assert found.measured > 0.0
    if outside > 0.05:
        assert found.measured == pytest.approx(outside, abs=0.1 + 0.01 * outside)
    if deep.max() < -EDGE:
        assert found.status is not SATISFIED
    if deep.min() >= 0.0:
        assert found.status is SATISFIED


def visit_depth(where, places):
    """How deep a visit goes, by the sides of the boxes here."""
    if isinstance(where, Along):
        return min(0.5, where.width / 4)
    if isinstance(where, Disc):
        return 0.0
    if isinstance(where, Half):
        return 0.5
    if isinstance(where, Box):
        low = max(where.x0, 0.0), max(where.y0, 0.0)
        high = min(where.x1, SIZE), min(where.y1, SIZE)
        return min(0.5, (high[0] - low[0]) / 4, (high[1] - low[1]) / 4)
    x0, y0, x1, y1 = next(iter(places)).geometry.bounds
    return min(0.5, (x1 - x0) / 4, (y1 - y0) / 4)


@given(PATHS, regions())
@settings(max_examples=50, deadline=None)
def test_a_visit_agrees_with_every_centimetre(points, region):
    where, places, depth = region
    if len(places) and depth_is_no_distance(places):
        return
    found = outcome(points, Visit(regions=(where,)), places=places)
    xy, _ = dense(points)
    off = (depth(xy) - visit_depth(where, places)).max()
    if isinstance(where, Disc):
        x, y = (math.floor(2 * value + 2e-6) / 2 for value in (where.x, where.y))
        off = max(off, box_depth(xy, x, y, x + 0.5, y + 0.5).max())
    if found.status is SATISFIED:
        assert off >= -0.01
    if off >= 1e-5:
        assert found.status is SATISFIED


@given(
    PATHS, st.lists(st.lists(st.tuples(QUARTERS, QUARTERS), min_size=1, max_size=2), max_size=3)
)
@settings(max_examples=50, deadline=None)
def test_the_order_of_visits_agrees_with_all_orders(points, groups):
    clauses = [Visit(regions=tuple(Disc(x, y, 2.0) for x, y in group)) for group in groups]
    found = outcomes(points, *clauses)
    xy, _ = dense(points)
    done = all(one.status is SATISFIED for one in found)
    if done:
        assert in_some_order(xy, groups, 2.0 + 0.02)
    if in_some_order(xy, groups, 2.0):
        assert done


def in_some_order(xy, groups, radius):
    """Whether the places are passed in one of the orders that are asked for."""
    for order in product(*(permutations(group) for group in groups)):
        place = 0
        for x, y in (centre for group in order for centre in group):
            ahead = np.flatnonzero(disc_depth(xy[place:], x, y, radius) >= 0.0)
            if not len(ahead):
                break
            place += int(ahead[0])
        else:
            return True
    return False


@given(PATHS, st.tuples(QUARTERS, QUARTERS), st.tuples(QUARTERS, QUARTERS))
@settings(max_examples=50, deadline=None)
def test_before_agrees_with_every_centimetre(points, first, second):
    found = outcome(points, Before(first=Disc(*first, 2.0), second=Disc(*second, 2.5)))
    xy, _ = dense(points)
    visits = np.flatnonzero(disc_depth(xy, *first, 2.0 + 0.02) >= 0.0)
    sure = np.flatnonzero(disc_depth(xy, *first, 2.0) >= 0.0)
    entries = np.flatnonzero(disc_depth(xy, *second, 2.5) > EDGE)
    late = np.flatnonzero(disc_depth(xy, *second, 2.5) > -0.02)
    if found.status is SATISFIED and len(entries):
        assert len(visits)
        assert visits[0] <= entries[0] + 1
    if not len(late) or (len(sure) and sure[0] < late[0]):
        assert found.status is SATISFIED


@given(PATHS, st.lists(st.tuples(st.integers(0, 39), st.integers(0, 39)), min_size=1, max_size=9),
       st.sampled_from([0.25, 0.5, 1.0, 3.0]), st.sampled_from([0.0, 0.7, -2.0]))  # fmt: skip
@settings(max_examples=50, deadline=None)
def test_the_distance_to_the_walls_agrees_with_every_centimetre(points, cells, metres, yaw):
    origin = Pose2D(3.0, -5.0, yaw)
    walls = [(x / 2, y / 2, x / 2 + 0.5, y / 2 + 0.5) for x, y in cells]
    costmap = field(walls=walls, origin=origin)
    moved = turned(points, yaw, origin[:2])
    found = outcome(moved, KeepDistance(metres=metres), costmap=costmap)
    xy, _ = dense(points)
    away = -np.max([box_depth(xy, *wall) for wall in walls], axis=0)
    short = max(0.02 * metres, 0.05)
    if found.status is SATISFIED and min(away[0], away[-1]) > metres:
        assert away.min() >= metres - short - 1e-6
    if away.min() >= metres:
        assert found.status is SATISFIED
    if found.status is VIOLATED and min(away[0], away[-1]) > metres:
        assert found.measured == pytest.approx(metres - max(0.0, away.min()), abs=0.01)


@given(PATHS, st.lists(st.tuples(st.integers(0, 39), st.integers(0, 39)), min_size=1, max_size=9),
       st.sampled_from([0.25, 0.5, 1.0, 3.0]), st.sampled_from([0.0, 0.7, -2.0]))  # fmt: skip
@settings(max_examples=50, deadline=None)
def test_the_length_near_the_walls_agrees_with_every_centimetre(points, cells, width, yaw):
    origin = Pose2D(3.0, -5.0, yaw)
    walls = [(x / 2, y / 2, x / 2 + 0.5, y / 2 + 0.5) for x, y in cells]
    costmap = field(walls=walls, origin=origin)
    strip = Along('walls', width)
    moved = turned(points, yaw, origin[:2])
    outside, inside = outcomes(moved, StayIn(region=strip), Avoid(region=strip), costmap=costmap)
    xy, at = dense(points)
    deep = width + np.max([box_depth(xy, *wall) for wall in walls], axis=0)
    if length_where(-deep, at) > 0.05:
        assert outside.measured == pytest.approx(length_where(-deep, at), abs=0.1, rel=0.01)
    if length_where(deep, at) > 0.05:
        assert inside.measured == pytest.approx(length_where(deep, at), abs=0.1, rel=0.01)
    assert inside.status is not SATISFIED or deep.max() <= EDGE
    assert outside.status is not SATISFIED or deep.min() >= -EDGE


@given(PATHS, st.tuples(QUARTERS, QUARTERS), st.sampled_from(['north', 'south', 'east', 'west']))
@settings(max_examples=80, deadline=None)
def test_pass_agrees_with_every_centimetre(points, corner, side):
    box = (*corner, corner[0] + 1.0, corner[1] + 2.0)
    places = Places([Place('it', shapely.box(*box), 'object')])
    found = outcome(points, Pass(region=NamedPlace('it'), side=side), places=places)
    xy, _ = dense(points)
    off = xy - (corner[0] + 0.5, corner[1] + 1.0)
    ahead = {'north': (0, 1), 'south': (0, -1), 'east': (1, 0), 'west': (-1, 0)}[side]
    across = ahead[0] * off[:, 1] - ahead[1] * off[:, 0]
    along = off @ ahead
    clear = np.abs(across) > 1e-5
    changes = np.flatnonzero(np.diff(np.sign(across[clear])))
    places_of = along[clear][changes]
    if found.status is SATISFIED:
        assert box_depth(xy, *box).max() <= EDGE
        assert (places_of > -0.05).any()
        assert not (places_of < -0.05).any()
    elif box_depth(xy, *box).max() <= 0.0 and len(places_of):
        touches_other_ray = (~clear & (along < 0.0)).any()
        assert places_of.min() < 0.05 or touches_other_ray


@given(PATHS, regions(), st.sampled_from([0.3, 1.5707963267948966, -2.5]))
@settings(max_examples=30, deadline=None)
def test_a_turned_world_changes_nothing(points, region, yaw):
    where, places, _ = region
    if not len(places):
        return
    origin = Pose2D(-7.0, 2.0, yaw)
    other = Places(
        Place('it', shapely.transform(one.geometry, lambda xy: turned(xy, yaw, origin[:2])))
        for one in places
    )
    clauses = [
        Avoid(region=where), Visit(regions=(where,)), StayIn(region=where),
        KeepDistance(metres=2.0, region=where), EndAt(region=where),
    ]  # fmt: skip
    if depth_is_no_distance(places):
        # Around a triangle there may be two smallest rectangles, of different widths.
        clauses = [clause for clause in clauses if not isinstance(clause, Visit)]
    if len({point[0] for point in points}) + len({point[1] for point in points}) == 2:
        return
    before = outcomes(points, *clauses, places=places)
    moved = turned(points, yaw, origin[:2])
    after = outcomes(moved, *clauses, places=other, costmap=field(origin=origin))
    for one, two in zip(before, after):
        if one.status is not two.status:
            # Only where the path runs along an edge may rounding decide.
            assert abs(one.measured - two.measured) < 1e-3 or one.measured < 2e-3
        elif not math.isnan(one.measured):
            assert one.measured == pytest.approx(two.measured, abs=2e-3)


@given(PATHS, regions(), st.integers(0, 2**32 - 1))
@settings(max_examples=50, deadline=None)
def test_more_points_on_the_same_way_change_nothing(points, region, seed):
    where, places, _ = region
    clauses = [
        Avoid(region=where), Visit(regions=(where,)), StayIn(region=where),
        KeepDistance(metres=2.0, region=where), Avoid(strength=SHOULD, region=where),
    ]  # fmt: skip
    xy, _ = dense(points)
    kept = np.random.default_rng(seed).random(len(xy)) < 0.02
    corners = np.isin(np.arange(len(xy)), corner_places(points))
    costmap = field()
    whole = verify(Specification(tuple(clauses)), points, route(costmap, points, places))
    fine = verify(
        Specification(tuple(clauses)), xy[kept | corners], route(costmap, points, places)
    )
    for one, two in zip(whole, fine):
        if one.status is not two.status:
            assert abs(one.measured - two.measured) < 1e-3
        elif not math.isnan(one.measured):
            assert one.measured == pytest.approx(two.measured, abs=1e-4)


def corner_places(points):
    """Where the corners of a path are among its dense points."""
    counts = [max(1, math.ceil(math.dist(a, b) / STEP)) for a, b in pairwise(points)]
    return np.concatenate(([0], np.cumsum(counts)))
