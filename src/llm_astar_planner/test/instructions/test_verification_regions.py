"""Regions that are made of others, and the ends of the request: paths by and through them."""

import math

import pytest
import shapely
from llm_astar_msgs_adapter.maps.places import Place, Places
from llm_astar_planner.instructions.clauses.avoid import Avoid
from llm_astar_planner.instructions.clauses.count import Count
from llm_astar_planner.instructions.clauses.end_at import EndAt
from llm_astar_planner.instructions.clauses.keep_distance import KeepDistance
from llm_astar_planner.instructions.clauses.pass_by import Pass
from llm_astar_planner.instructions.clauses.stay_in import StayIn
from llm_astar_planner.instructions.clauses.visit import Visit
from llm_astar_planner.instructions.regions import (
    AllOf,
    Along,
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
from llm_astar_planner.instructions.specification import Specification
from llm_astar_planner.instructions.verification.verify import verify
from verified_maps import (
    IMPOSSIBLE,
    NOT_UNDERSTOOD,
    PLACES,
    SATISFIED,
    VIOLATED,
    field,
    outcome,
    outcomes,
)

KITCHEN, LAB, RACK, DOCK = map(NamedPlace, ('kitchen', 'lab', 'rack', 'dock'))
PAST = [(1.25, 1.25), (18.75, 1.25)]
THROUGH = [(1.25, 6.25), (18.75, 6.25)]
TO_THE_KITCHEN = [(1.25, 6.25), (6.25, 6.25), (6.25, 1.25)]
EITHER = AnyOf((KITCHEN, LAB))
BLUE = Tagged('blue')


def test_either_of_two_is_visited():
    assert outcome(TO_THE_KITCHEN, Visit(regions=(EITHER,))).status is SATISFIED
    assert outcome(PAST, Visit(regions=(EITHER,))).status is VIOLATED
    assert outcome(THROUGH, Count(region=EITHER, at_least=2, at_most=2)).status is SATISFIED


def test_both_are_avoided_and_measured_together():
    found = outcome(THROUGH, Avoid(region=EITHER))
    assert (found.status, found.measured) == (VIOLATED, pytest.approx(8.0, abs=1e-4))
    overlapping = AnyOf((KITCHEN, Box(6.0, 5.0, 10.0, 7.0), Disc(6.0, 6.0, 3.0)))
    assert outcome(THROUGH, Avoid(region=overlapping)).measured == pytest.approx(7.0, abs=0.02)
    assert outcome(PAST, Avoid(region=EITHER)).status is SATISFIED
    assert outcome(THROUGH, KeepDistance(metres=1.0, region=EITHER)).status is VIOLATED
    assert outcome(PAST, KeepDistance(metres=2.75, region=EITHER)).status is SATISFIED


def test_a_disc_stays_exact_in_what_is_joined():
    round_one = AnyOf((Disc(10, 10, 3), LAB))
    assert outcome([(1.0, 13.0), (19.0, 13.0)], Avoid(region=round_one)).status is SATISFIED
    assert outcome([(1.0, 12.999), (19.0, 12.999)], Avoid(region=round_one)).status is VIOLATED
    without = Except(Disc(10, 10, 3), (LAB,))
    assert outcome([(1.0, 12.999), (19.0, 12.999)], Avoid(region=without)).status is VIOLATED


def test_what_regions_have_in_common():
    part = AllOf((KITCHEN, Box(6.0, -math.inf, math.inf, math.inf)))
    assert outcome(THROUGH, Avoid(region=part)).measured == pytest.approx(2.0, abs=1e-4)
    assert outcome([(5.0, 1.0), (5.0, 19.0)], Avoid(region=part)).status is SATISFIED
    assert outcome([(5.0, 1.0), (5.0, 19.0)], Visit(regions=(part,))).status is VIOLATED
    assert outcome(THROUGH, Visit(regions=(part,))).status is SATISFIED
    # The part is 2 m wide, so a visit goes half a metre into it.
    for x, status in ((6.49, VIOLATED), (6.5, SATISFIED)):
        assert outcome([(x, 1.0), (x, 19.0)], Visit(regions=(part,))).status is status
    three = AllOf((KITCHEN, Half('south'), Half('west')))
    assert outcome(THROUGH, Avoid(region=three)).measured == pytest.approx(4.0, abs=1e-4)


def test_a_part_of_each_place_of_a_tag():
    south = AllOf((BLUE, Box(-math.inf, -math.inf, math.inf, 5.0)))
    low, high = [(1.0, 4.5), (19.0, 4.5)], [(1.0, 5.5), (19.0, 5.5)]
    assert outcome(low, Avoid(region=south)).measured == pytest.approx(8.0, abs=1e-4)
    assert outcome(high, Avoid(region=south)).status is SATISFIED
    assert outcome(low, Visit(regions=(south,))).status is SATISFIED


def test_a_side_of_an_object_is_near_it_too():
    north = AllOf((Half('north'), RACK))
    assert outcome([(8.1, 1.0), (8.1, 19.0)], Visit(regions=(north,))).status is SATISFIED
    assert outcome([(7.9, 1.0), (7.9, 19.0)], Visit(regions=(north,))).status is VIOLATED
    assert outcome(PAST, Visit(regions=(AllOf((RACK, Half('south'))),))).status is IMPOSSIBLE


def test_all_places_except_one():
    others = Except(BLUE, (LAB,))
    assert outcome(TO_THE_KITCHEN, Visit(regions=(others,))).status is SATISFIED
    assert outcome([(10.0, 6.0), (18.0, 6.0)], Visit(regions=(others,))).status is VIOLATED
    assert outcome([(10.0, 6.0), (18.0, 6.0)], Avoid(region=others)).status is SATISFIED
    assert outcome(THROUGH, Avoid(region=others)).measured == pytest.approx(4.0, abs=1e-4)


def test_a_place_without_a_part_of_it():
    rim = Except(KITCHEN, (Box(5.0, 5.0, 7.0, 7.0),))
    assert outcome(THROUGH, Avoid(region=rim)).measured == pytest.approx(2.0, abs=1e-4)
    assert outcome([(5.0, 5.0), (7.0, 7.0)], Avoid(region=rim)).status is SATISFIED
    assert outcome([(5.0, 5.0), (7.0, 7.0)], StayIn(region=rim)).status is not SATISFIED
    north = Except(Half('north'), (RACK, DOCK))
    assert outcome([(1.0, 15.0), (8.9, 15.0)], StayIn(region=north)).status is SATISFIED
    assert outcome([(1.0, 15.0), (9.1, 15.0)], StayIn(region=north)).status is not SATISFIED


def test_nothing_is_left():
    nothing = Except(KITCHEN, (Half('south'),))
    found = outcome(PAST, Avoid(region=nothing))
    assert (found.status, found.detail) == (NOT_UNDERSTOOD, 'the region has no area')
    assert outcome(PAST, Visit(regions=(nothing,))).status is IMPOSSIBLE
    apart = AllOf((KITCHEN, LAB))
    assert outcome(PAST, Avoid(region=apart)).status is NOT_UNDERSTOOD


def test_regions_within_regions():
    nested = Except(AnyOf((KITCHEN, AllOf((LAB, Half('south'))))), (Box(0.0, 0.0, 6.0, 20.0),))
    assert outcome(THROUGH, Avoid(region=nested)).measured == pytest.approx(6.0, abs=1e-4)


def test_an_object_among_rooms_is_near_to_visit_and_entered_so():
    mixed = AnyOf((KITCHEN, RACK))
    assert outcome([(8.1, 9.0), (8.1, 19.0)], Visit(regions=(mixed,))).status is SATISFIED
    assert outcome([(7.9, 9.0), (7.9, 19.0)], Visit(regions=(mixed,))).status is VIOLATED


@pytest.mark.parametrize('region', [
    AnyOf((NamedPlace('attic'), KITCHEN)), AllOf((KITCHEN, Tagged('green'))),
    Except(KITCHEN, (NamedPlace('attic'),)), AnyOf((KITCHEN, Along('walls', 1.0))),
    Except(Along('walls', 1.0), (KITCHEN,)), AllOf((Along('walls', 1.0), KITCHEN)),
], ids=str)  # fmt: skip
def test_nothing_is_claimed_of_parts_that_do_not_exist_or_of_all_walls(region):
    costmap = field(walls=[(0.0, 0.0, 20.0, 0.5)])
    clauses = [
        Avoid(region=region), Visit(regions=(region,)), StayIn(region=region),
        EndAt(region=region), KeepDistance(metres=1.0, region=region), Count(region=region),
        Pass(region=region, side='north'),
    ]  # fmt: skip
    for found in outcomes(PAST, *clauses, costmap=costmap):
        assert found.status is NOT_UNDERSTOOD


def test_the_ends_of_the_request():
    assert outcome(PAST, Visit(regions=(End('goal'),))).status is SATISFIED
    assert outcome(PAST, EndAt(region=End('goal'))).status is SATISFIED
    assert outcome(PAST, EndAt(region=End('start'))).status is VIOLATED
    back = Visit(regions=(End('goal'),)), EndAt(region=End('start'))
    there_and_back = [*PAST, (1.25, 1.25)]
    costmap = field()
    ends = [costmap.grid_map.world_to_cell(*point) for point in PAST]
    route = Route(costmap, *ends, PLACES)
    for points, statuses in (
        (there_and_back, [SATISFIED, SATISFIED]),
        (PAST, [SATISFIED, VIOLATED]),
        ([PAST[0], (1.7, 1.25)], [VIOLATED, SATISFIED]),
        ([PAST[0], (1.8, 1.25)], [VIOLATED, VIOLATED]),
    ):
        found = verify(Specification(back), points, route)
        assert [one.status for one in found] == statuses


def test_the_start_is_where_the_drive_began():
    driven = [(1.25, 1.25), (10.25, 1.25)]
    rest = [(10.25, 1.25), (18.75, 1.25), (1.25, 1.25)]
    assert outcome(rest, EndAt(region=End('start')), driven=driven).status is SATISFIED
    assert outcome(rest[:2], EndAt(region=End('start')), driven=driven).status is VIOLATED
    assert outcome(rest[:2], Visit(regions=(End('start'),)), driven=driven).status is SATISFIED
    stop = [(10.25, 1.25), (18.75, 1.25), (10.25, 1.25)]
    assert outcome(stop, EndAt(region=End('start')), driven=driven).status is VIOLATED


def test_the_sides_are_those_of_the_way_from_where_the_drive_began():
    driven = [(1.25, 1.25), (1.25, 18.75)]
    rest = [(1.25, 18.75), (18.75, 18.75)]
    assert outcome(rest, StayIn(region=Half('left')), driven=driven).status is SATISFIED
    passed = Pass(region=NamedPlace('it'), side='left')
    places = Places([Place('it', shapely.box(9.0, 9.0, 11.0, 11.0), 'object')])
    assert outcome(rest, passed, driven=driven, places=places).status is SATISFIED
