"""Paths that satisfy and paths that violate, by little and by much, for each clause and region."""

import ast
import math
from importlib import import_module
from pathlib import Path

import numpy as np
import pytest
import shapely
from llm_astar_msgs_adapter.maps.grid_map import GridMap, Pose2D
from llm_astar_msgs_adapter.maps.places import Place, Places
from llm_astar_planner.costmap.config import CostmapConfig
from llm_astar_planner.costmap.costmap import Costmap
from llm_astar_planner.instructions import verification
from llm_astar_planner.instructions.clauses.avoid import Avoid
from llm_astar_planner.instructions.clauses.before import Before
from llm_astar_planner.instructions.clauses.clause import SHOULD
from llm_astar_planner.instructions.clauses.end_at import EndAt
from llm_astar_planner.instructions.clauses.keep_distance import KeepDistance
from llm_astar_planner.instructions.clauses.pass_by import Pass
from llm_astar_planner.instructions.clauses.stay_in import StayIn
from llm_astar_planner.instructions.clauses.unknown import Unknown
from llm_astar_planner.instructions.clauses.unsupported import Unsupported
from llm_astar_planner.instructions.clauses.visit import Visit
from llm_astar_planner.instructions.outcome import ClauseStatus
from llm_astar_planner.instructions.regions import (
    Along,
    Between,
    Box,
    Disc,
    Half,
    NamedPlace,
    Tagged,
)
from llm_astar_planner.instructions.route import Route
from llm_astar_planner.instructions.specification import CLAUSES, NOTHING_ASKED, Specification
from llm_astar_planner.instructions.verification.geometry import PathError
from llm_astar_planner.instructions.verification.verify import verify
from llm_astar_planner.instructions.verification.walls import Walls
from verified_maps import (
    AS_FAR,
    IMPOSSIBLE,
    NOT_UNDERSTOOD,
    PLACES,
    SATISFIED,
    UNSUPPORTED,
    UNSURE,
    VIOLATED,
    field,
    outcome,
    outcomes,
    route,
    turned,
)

KITCHEN, LAB, RACK, DOCK = map(NamedPlace, ('kitchen', 'lab', 'rack', 'dock'))
PAST = [(1.25, 1.25), (18.75, 1.25)]
THROUGH = [(1.25, 6.25), (18.75, 6.25)]


def test_a_path_past_a_place_avoids_it():
    assert outcome(PAST, Avoid(region=KITCHEN)).status is SATISFIED


def test_a_path_through_a_place_is_measured():
    found = outcome(THROUGH, Avoid(region=KITCHEN))
    assert found.status is VIOLATED
    assert found.measured == pytest.approx(4.0, abs=1e-4)
    assert found.where == pytest.approx((4.0, 6.25), abs=1e-4)
    assert found.least == 0.0


def test_a_path_along_the_edge_of_a_place_avoids_it():
    assert outcome([(1.0, 4.0), (19.0, 4.0)], Avoid(region=KITCHEN)).status is SATISFIED


def test_the_same_by_a_hair_inside_does_not():
    found = outcome([(1.0, 4.00001), (19.0, 4.00001)], Avoid(region=KITCHEN))
    assert found.status is VIOLATED


@pytest.mark.parametrize(('y', 'status'), [(3.0, SATISFIED), (3.001, VIOLATED)])
def test_the_margin_counts(y, status):
    assert outcome([(1.0, y), (19.0, y)], Avoid(region=KITCHEN, margin=1.0)).status is status


def test_a_tangent_of_a_circle_avoids_it():
    assert outcome([(1.0, 13.0), (19.0, 13.0)], Avoid(region=Disc(10, 10, 3))).status is SATISFIED
    assert outcome([(1.0, 12.99), (19.0, 12.99)], Avoid(region=Disc(10, 10, 3))).status is VIOLATED


def test_a_cut_corner_of_three_centimetres_counts():
    found = outcome([(3.51, 4.51), (4.51, 3.51)], Avoid(region=KITCHEN))
    assert found.status is VIOLATED
    assert found.measured == pytest.approx(0.02 * math.sqrt(2.0), abs=1e-4)
    assert found.detail == '0.028 m inside, from 4.0, 4.0'


def test_a_wish_to_avoid_allows_the_least_possible_alone():
    wish = Avoid(SHOULD, region=Box(8.0, -math.inf, 9.0, math.inf))
    straight = outcome([(1.25, 1.25), (18.75, 1.25)], wish)
    assert straight.status is AS_FAR
    assert straight.detail == '1.0 m inside, the least possible, from 8.0, 1.2'
    slant = outcome([(1.25, 1.25), (8.25, 1.25), (8.25, 5.25), (18.75, 5.25)], wish)
    assert slant.status is VIOLATED
    assert slant.least == pytest.approx(1.0, abs=0.05)
    needless = [(1.25, 3.75), (4.25, 4.05), (8.75, 3.75)]
    assert outcome(needless, Avoid(SHOULD, region=KITCHEN)).status is VIOLATED


def test_who_starts_inside_may_leave_by_the_shortest_way():
    out = [(6.25, 6.25), (6.25, 1.25), (18.75, 1.25)]
    across = [(6.25, 6.25), (18.75, 6.25)]
    along = [(6.25, 6.25), (6.25, 5.25), (4.25, 5.25), (4.25, 7.75), (2.25, 7.75), (18.75, 1.25)]
    wish = Avoid(region=KITCHEN, strength=SHOULD)
    assert outcome(out, wish).status is AS_FAR
    assert outcome(across, wish).status is AS_FAR
    found = outcome(along, wish)
    assert found.status is VIOLATED
    assert found.least == pytest.approx(1.75, abs=0.01)
    # A must is never said to be kept by a path that has a part inside.
    assert outcome(out, Avoid(region=KITCHEN)).status is IMPOSSIBLE


def test_visits_count_in_their_order():
    both = Visit(regions=(KITCHEN,)), Visit(regions=(LAB,))
    assert [one.status for one in outcomes(THROUGH, *both)] == [SATISFIED, SATISFIED]
    back = THROUGH[::-1]
    assert [one.status for one in outcomes(back, *both)] == [SATISFIED, VIOLATED]
    group = Visit(regions=(LAB, KITCHEN))
    assert outcome(THROUGH, group).status is SATISFIED


def test_an_object_is_visited_within_a_metre():
    assert outcome([(8.1, 1.0), (8.1, 19.0)], Visit(regions=(RACK,))).status is SATISFIED
    found = outcome([(7.9, 1.0), (7.9, 19.0)], Visit(regions=(RACK,)))
    assert found.status is VIOLATED
    assert found.detail == 'never nearer than 1.1 m'


def test_stay_in_allows_the_least_possible():
    south = StayIn(region=Half('south'), strength=SHOULD)
    assert outcome(PAST, south).status is SATISFIED
    start_in_the_north = [(1.25, 15.25), (1.25, 1.25), (18.75, 1.25)]
    assert outcome(start_in_the_north, south).status is AS_FAR
    assert outcome([(1.25, 15.25), (18.75, 15.25), (18.75, 1.25)], south).status is VIOLATED


def test_pass_looks_at_both_sides():
    north, south = ([(1.0, 10.0), (10.0, y), (19.0, 10.0)] for y in (18.0, 2.0))
    assert outcome(north, Pass(region=RACK, side='north')).status is SATISFIED
    assert outcome(south, Pass(region=RACK, side='north')).status is VIOLATED
    assert outcome(north, Pass(region=RACK, side='left')).status is SATISFIED


def test_a_wall_across_the_map_leaves_no_way():
    costmap = field(walls=[(9.0, 5.0, 10.0, 20.0)])
    gap = Box(9.0, 0.0, 10.0, 5.0)
    found = outcome([(1.25, 1.25), (18.75, 1.25)], Avoid(region=gap), costmap=costmap)
    assert found.status is IMPOSSIBLE
    assert found.least == pytest.approx(1.0, abs=1e-3)


def test_walls_are_the_squares_of_lethal_cells():
    costmap = field(walls=[(9.0, 5.0, 10.0, 20.0)])
    points = [(1.25, 2.25), (18.75, 2.25)]
    assert outcome(points, KeepDistance(metres=2.75), costmap=costmap).status is SATISFIED
    assert outcome(points, KeepDistance(metres=2.9), costmap=costmap).status is VIOLATED


def test_nothing_is_claimed_of_what_does_not_exist():
    found = outcome(PAST, Avoid(region=NamedPlace('ballroom')))
    assert found.status is NOT_UNDERSTOOD
    assert 'ballroom' in found.detail
    assert outcome(PAST, Avoid(region=Tagged('green'))).status is NOT_UNDERSTOOD
    assert outcome(PAST, Unknown(text='hm')).status is NOT_UNDERSTOOD
    assert outcome(PAST, Avoid(region=Box(3.0, 3.0, 3.0, 8.0))).status is NOT_UNDERSTOOD


def test_a_clause_that_is_not_certain_is_never_kept():
    found = outcome(PAST, Avoid(region=KITCHEN, unsure='Did you mean the kitchen?'))
    assert found.status is UNSURE
    assert found.detail == 'Did you mean the kitchen? (kept: 0.0 m inside)'


def test_nothing_is_claimed_of_what_a_path_does_not_have():
    found = outcome(PAST, Unsupported(text='slowly', about='speed'))
    assert (found.status, found.detail) == (UNSUPPORTED, '')


def test_before_looks_at_the_first_entry():
    clause = Before(first=LAB, second=KITCHEN)
    assert outcome(PAST, clause).status is SATISFIED
    assert outcome(THROUGH[::-1], clause).status is SATISFIED
    assert outcome(THROUGH, clause).status is VIOLATED


def test_end_at_looks_at_the_last_point():
    assert outcome([(1.25, 1.25), (6.25, 6.25)], EndAt(region=KITCHEN)).status is SATISFIED
    assert outcome(THROUGH, EndAt(region=KITCHEN)).status is VIOLATED


def test_pieces_of_a_place_and_repaired_outlines_are_measured():
    bow_tie = shapely.Polygon([(4, 4), (8, 8), (8, 4), (4, 8)])
    two = shapely.MultiPolygon([shapely.box(2, 5, 3, 7), shapely.box(12, 5, 15, 7)])
    places = Places([Place('tie', bow_tie), Place('two', two)])
    found = outcome(THROUGH, Avoid(region=NamedPlace('tie')), places=places)
    assert found.measured == pytest.approx(3.5, abs=1e-4)
    assert outcome(
        THROUGH, Avoid(region=NamedPlace('two')), places=places
    ).measured == pytest.approx(4.0, abs=1e-4)
    assert outcome(THROUGH, Visit(regions=(NamedPlace('two'),)), places=places).status is SATISFIED


@pytest.mark.parametrize(
    'geometry',
    [
        shapely.Polygon(),
        shapely.Polygon([(4, 4), (8, 8), (6, 6)]),
        shapely.LineString([(4, 4), (8, 8)]),
    ],
    ids=['empty', 'flat', 'line'],
)
def test_nothing_is_claimed_of_a_place_without_area(geometry):
    places = Places([Place('it', geometry), Place('lab', shapely.box(12, 4, 16, 8))])
    it = NamedPlace('it')
    clauses = [
        Avoid(region=it), Avoid(region=it, margin=1.0), Visit(regions=(it,)), StayIn(region=it),
        Before(first=it, second=LAB), Before(first=LAB, second=it), Pass(region=it, side='north'),
        KeepDistance(metres=1.0, region=it), EndAt(region=it), Avoid(region=Half('north', 'it')),
        StayIn(SHOULD, region=it), Visit(regions=(Along('it', 0.5),)),
    ]  # fmt: skip
    for found in outcomes(PAST, *clauses, places=places):
        assert found.status in {NOT_UNDERSTOOD, IMPOSSIBLE}
        assert 'no area' in found.detail


def test_a_place_off_the_map_is_avoided_and_cannot_be_visited():
    far = NamedPlace('far hall')
    avoided, visited, stayed, ended = outcomes(
        PAST, Avoid(region=far), Visit(regions=(far,)), StayIn(region=far), EndAt(region=far)
    )
    assert avoided.status is SATISFIED
    for found in (avoided, visited, stayed, ended):
        assert 'off the map' in found.detail
    assert {visited.status, stayed.status, ended.status} == {IMPOSSIBLE}


def test_a_visit_goes_well_inside():
    def status(y, region):
        return outcome([(1.0, y), (19.0, y)], Visit(regions=(region,))).status

    assert status(4.5, KITCHEN) is SATISFIED
    assert status(4.49, KITCHEN) is VIOLATED
    assert status(4.26, Box(4.0, 4.0, 8.0, 5.0)) is SATISFIED
    assert status(4.24, Box(4.0, 4.0, 8.0, 5.0)) is VIOLATED
    assert status(18.4, DOCK) is SATISFIED
    assert status(18.6, DOCK) is VIOLATED
    found = outcome([(1.0, 4.1), (19.0, 4.1)], Visit(regions=(KITCHEN,)))
    assert found.detail == 'entered, but 0.4 m short of a visit'


def test_a_visit_of_a_thin_ring_goes_into_its_middle():
    ring = shapely.Polygon(
        shapely.box(2, 2, 12, 12).exterior, [shapely.box(2.6, 2.6, 11.4, 11.4).exterior]
    )
    places = Places([Place('ring', ring)])
    visit = Visit(regions=(NamedPlace('ring'),))
    assert outcome([(1.0, 2.3), (19.0, 2.3)], visit, places=places).status is SATISFIED
    assert outcome([(1.0, 7.0), (2.05, 7.0)], visit, places=places).status is VIOLATED


def test_a_point_is_visited_through_its_cell_where_cells_are_large():
    coarse = field(1.0)
    visit = Visit(regions=(Disc(10.9, 10.9),))
    points = [(1.5, 10.5), (10.5, 10.5), (10.5, 1.5)]
    assert outcome(points, visit, costmap=coarse).status is SATISFIED
    assert outcome(points, visit).status is VIOLATED


def test_any_place_of_a_tag_is_enough():
    blue = Visit(regions=(Tagged('blue'),))
    assert outcome([(10.0, 6.0), (14.0, 6.0)], blue).status is SATISFIED
    assert outcome([(10.0, 6.0), (10.0, 2.0)], blue).status is VIOLATED
    assert outcome(THROUGH, Avoid(region=Tagged('BLUE'))).measured == pytest.approx(8.0, abs=1e-4)


def test_a_small_object_is_visited_within_a_metre_of_its_point():
    places = Places([Place('lamp', shapely.Point(10.0, 10.0), 'object')])
    lamp = Visit(regions=(NamedPlace('lamp'),))
    assert outcome([(1.0, 10.9), (19.0, 10.9)], lamp, places=places).status is SATISFIED
    assert outcome([(1.0, 11.1), (19.0, 11.1)], lamp, places=places).status is VIOLATED


def test_there_is_no_visit_of_what_lies_in_walls_or_behind_them():
    costmap = field(walls=[(3.0, 3.0, 9.0, 9.0), (15.0, 15.0, 19.5, 19.5)])
    walled = field(walls=[(3.0, 3.0, 9.0, 4.0), (3.0, 8.0, 9.0, 9.0), (3.0, 3.0, 4.0, 9.0),
                          (8.0, 3.0, 9.0, 9.0)])  # fmt: skip
    for where in (costmap, walled):
        for clause in (Visit(regions=(KITCHEN,)), EndAt(region=KITCHEN), StayIn(region=KITCHEN)):
            found = outcome(PAST, clause, costmap=where)
            assert found.status is IMPOSSIBLE
            assert found.detail == 'no free cell of it can be reached'
    assert outcome(PAST, Visit(regions=(Disc(6.0, 6.0),)), costmap=costmap).status is IMPOSSIBLE
    assert outcome(PAST, Visit(regions=(Disc(6.0, 2.0),)), costmap=costmap).status is VIOLATED


def test_one_region_of_several_that_cannot_be_reached_makes_a_visit_impossible():
    costmap = field(walls=[(3.0, 3.0, 9.0, 9.0)])
    found = outcome(PAST, Visit(regions=(LAB, KITCHEN)), costmap=costmap)
    assert found.status is IMPOSSIBLE
    after = outcomes(THROUGH[::-1], Visit(regions=(LAB,)), Visit(regions=(DOCK,)))
    assert [one.status for one in after] == [SATISFIED, VIOLATED]


def test_the_way_driven_counts_for_order_and_number():
    both = Visit(regions=(LAB,)), Visit(regions=(KITCHEN,))
    driven = [(18.25, 6.25), (1.25, 6.25)]
    found = outcomes(PAST, *both, driven=driven)
    assert [one.status for one in found] == [SATISFIED, SATISFIED]
    assert found[0].detail == 'reached at 15.5, 6.2 on the way driven'
    assert [one.status for one in outcomes(PAST, *both)] == [VIOLATED, VIOLATED]
    assert outcomes(THROUGH, *both, driven=driven[:1])[1].status is SATISFIED
    half = [(18.25, 6.25), (10.25, 6.25), (10.25, 1.25)]
    assert [one.status for one in outcomes(PAST, *both, driven=half)] == [SATISFIED, VIOLATED]
    clause = Before(first=LAB, second=KITCHEN)
    assert outcome(THROUGH, clause).status is VIOLATED
    assert outcome(THROUGH, clause, driven=half).status is SATISFIED
    assert outcome(PAST, clause, driven=[(6.0, 6.0)]).status is VIOLATED
    passed, short = Pass(region=RACK, side='north'), [(12.0, 18.0), (19.0, 18.0)]
    over = [(1.0, 10.0), (8.0, 18.0)]
    assert outcome(PAST, passed, driven=over).status is VIOLATED
    assert outcome(short, passed).status is VIOLATED
    assert outcome(short, passed, driven=over).status is SATISFIED


def test_the_way_driven_does_not_count_for_lengths():
    driven = [(6.25, 6.25), (1.25, 1.25)]
    clauses = [
        Avoid(region=KITCHEN), StayIn(region=Half('south')), KeepDistance(metres=1.0, region=LAB),
        EndAt(region=Box(18.0, 0.0, 20.0, 2.0)),
    ]  # fmt: skip
    for found in outcomes(PAST, *clauses, driven=[(14.0, 6.0), (6.0, 18.0), *driven]):
        assert found.status is SATISFIED


def test_what_nobody_can_visit_holds_up_nothing():
    clauses = Visit(regions=(KITCHEN,)), Visit(regions=(LAB,))
    points = [(1.0, 1.0), (14.0, 1.0), (14.0, 6.0)]
    filled = field(walls=[(3.0, 3.0, 9.0, 9.0)])
    found = outcomes(points, *clauses, costmap=filled)
    assert [one.status for one in found] == [IMPOSSIBLE, SATISFIED]


def test_before_is_impossible_where_one_starts_in_the_second():
    assert outcome(THROUGH[::-1], Before(first=KITCHEN, second=LAB)).status is VIOLATED
    start = [(14.25, 6.25), (1.25, 6.25)]
    assert outcome(start, Before(first=KITCHEN, second=LAB)).status is IMPOSSIBLE
    assert outcome(start, Before(first=LAB, second=KITCHEN)).status is SATISFIED


def test_before_is_impossible_where_the_first_lies_behind_the_second():
    costmap = field(walls=[(0.0, 9.0, 20.0, 10.0)])
    gate = Box(0.0, 0.0, 20.0, 3.0)
    there = [(1.25, 5.25), (1.25, 1.25), (18.75, 1.25)]
    assert outcome(there, Before(first=KITCHEN, second=gate), costmap=costmap).status is VIOLATED
    behind = Before(first=Box(0.0, 0.0, 20.0, 1.0), second=gate)
    assert outcome(there, behind, costmap=costmap).status is IMPOSSIBLE


def test_touching_the_edge_of_the_second_is_not_entering_it():
    clause = Before(first=LAB, second=KITCHEN)
    assert outcome([(1.0, 4.0), (19.0, 4.0)], clause).status is SATISFIED
    assert outcome([(1.0, 4.01), (19.0, 4.01)], clause).status is VIOLATED


def test_staying_in_is_not_said_of_a_path_that_never_enters():
    far = Box(0.0, 18.0, 20.0, 20.0)
    assert outcome([(1.25, 1.25), (3.25, 1.25)], StayIn(region=far)).status is IMPOSSIBLE
    wish = outcome([(1.25, 1.25), (3.25, 1.25)], StayIn(SHOULD, region=far))
    assert wish.status is AS_FAR
    assert wish.detail == '2.0 m outside, the least possible, from 1.2, 1.2'


def test_no_excursion_is_allowed_where_one_can_stay_in():
    out = [(4.25, 6.25), (4.25, 8.25), (7.75, 6.25)]
    found = outcome(out, StayIn(region=KITCHEN))
    assert found.status is VIOLATED
    assert found.measured == pytest.approx(0.25 * (1.0 + math.hypot(3.5, 2.0) / 2.0), abs=1e-3)
    assert found.least == 0.0
    short = [(4.25, 7.75), (5.25, 8.01), (7.75, 7.75)]
    assert outcome(short, StayIn(SHOULD, region=KITCHEN)).status is VIOLATED
    assert (
        outcome([(4.0, 8.0), (8.0, 8.0), (8.0, 4.0)], StayIn(region=KITCHEN)).status is SATISFIED
    )


def test_one_point_is_judged_where_it_is():
    def status(clause, point=(6.25, 6.25)):
        return outcome([point], clause).status

    assert status(Visit(regions=(KITCHEN,))) is SATISFIED
    assert status(StayIn(region=KITCHEN)) is SATISFIED
    assert status(EndAt(region=KITCHEN)) is SATISFIED
    assert status(StayIn(region=KITCHEN), (1.25, 1.25)) is IMPOSSIBLE
    assert status(Visit(regions=(DOCK,)), (18.25, 18.25)) is SATISFIED
    assert status(Avoid(region=KITCHEN), (1.25, 1.25)) is SATISFIED
    assert status(Avoid(region=KITCHEN)) is IMPOSSIBLE
    assert status(Pass(region=RACK, side='north'), (10.25, 17.25)) is VIOLATED
    assert status(Avoid(region=Half('left'))) is NOT_UNDERSTOOD


@pytest.mark.parametrize('points', [[], [(1.0, math.nan)], [(math.inf, 1.0), (2.0, 2.0)]])
def test_what_is_no_path_is_refused(points):
    ends = [(1.25, 1.25), (2.25, 1.25)]
    with pytest.raises(PathError):
        verify(Specification((Avoid(region=KITCHEN),)), points, route(field(), ends))


def test_ends_near_a_wall_are_excepted_up_to_where_the_path_leaves_them():
    costmap = field(walls=[(0.0, 0.0, 20.0, 0.5), (0.0, 19.5, 20.0, 20.0)])
    keep = KeepDistance(metres=2.0)
    leave = [(1.25, 0.75), (1.25, 6.25), (18.75, 6.25), (18.75, 0.75)]
    found = outcome(leave, keep, costmap=costmap)
    assert found.status is ClauseStatus.AS_FAR_AS_POSSIBLE
    assert 'at its ends' in found.detail
    again = [(1.25, 0.75), (1.25, 6.25), (9.25, 2.35), (18.75, 6.25), (18.75, 0.75)]
    found = outcome(again, keep, costmap=costmap)
    assert found.status is VIOLATED
    assert found.measured == pytest.approx(0.15, abs=1e-6)
    assert found.detail == 'least distance 1.9 m of 2 m, at 9.2, 2.4'
    along = [(1.25, 0.75), (4.25, 0.75), (4.25, 6.25), (18.75, 6.25), (18.75, 0.75)]
    assert outcome(along, keep, costmap=costmap).status is VIOLATED
    whole = outcome([(1.25, 0.75), (18.75, 0.75)], keep, costmap=costmap)
    assert whole.status is VIOLATED


def test_a_wish_for_distance_is_not_met_by_a_needless_approach():
    costmap = field(walls=[(9.0, 9.0, 10.0, 10.0)])
    near = [(1.25, 1.25), (7.08, 9.25), (1.25, 18.75)]
    wish = KeepDistance(SHOULD, metres=2.0)
    assert outcome(near, wish, costmap=costmap).status is VIOLATED
    away = [(1.25, 1.25), (6.95, 9.25), (1.25, 18.75)]
    assert outcome(away, wish, costmap=costmap).status is SATISFIED


def test_a_gap_too_narrow_for_a_distance_leaves_the_most_that_passes():
    costmap = field(walls=[(9.0, 0.0, 10.0, 8.0), (9.0, 11.0, 10.0, 20.0)])
    through = [(1.25, 9.75), (18.75, 9.75)]
    found = outcome(through, KeepDistance(metres=2.0), costmap=costmap)
    assert found.status is AS_FAR
    assert found.detail == '1.2 m of 2 m, the most that passes, at 10.0, 9.8'
    assert found.measured == pytest.approx(0.75)
    less = outcome([(1.25, 9.75), (9.25, 10.75), (18.75, 9.75)], KeepDistance(metres=2.0),
                   costmap=costmap)  # fmt: skip
    assert less.status is VIOLATED
    assert less.detail.endswith(', 1.2 m is possible')
    assert outcome(through, KeepDistance(metres=1.25), costmap=costmap).status is SATISFIED
    high = [(1.25, 9.75), (9.25, 10.75), (18.75, 9.75)]
    assert outcome(high, KeepDistance(metres=1.25), costmap=costmap).status is VIOLATED
    wish = KeepDistance(SHOULD, metres=2.0)
    assert outcome(through, wish, costmap=costmap).status is AS_FAR


def test_the_most_that_passes_a_place_is_as_far_as_possible():
    costmap = field(walls=[(4.0, 9.5, 8.0, 20.0)])
    keep = KeepDistance(metres=5.0, region=KITCHEN)
    found = outcome([(1.25, 15.25), (1.25, 1.25), (18.75, 1.25)], keep, costmap=costmap)
    assert found.status is VIOLATED
    assert found.measured == pytest.approx(5.0 - 2.75, abs=1e-6)
    assert found.detail.endswith(', 3.7 m is possible')
    edge = [(1.25, 15.25), (0.25, 14.25), (0.25, 0.25), (18.75, 0.25), (18.75, 1.25)]
    found = outcome(edge, keep, costmap=costmap)
    assert (found.status, found.measured) == (AS_FAR, pytest.approx(5.0 - 3.75))
    assert outcome(edge, KeepDistance(metres=3.7, region=KITCHEN)).status is SATISFIED


def test_a_distance_that_no_path_keeps_at_all_is_impossible():
    costmap = field(walls=[(9.0, 5.0, 10.0, 20.0)])
    keep = KeepDistance(metres=1.0, region=Box(9.0, 0.0, 10.0, 5.0))
    found = outcome(PAST, keep, costmap=costmap)
    assert (found.status, found.measured) == (IMPOSSIBLE, 1.0)


def test_no_distance_is_kept_from_what_holds_the_start_or_the_goal():
    for points in ([(6.25, 6.25), *PAST], [*PAST, (6.25, 6.25)]):
        keep = KeepDistance(metres=3.0, region=KITCHEN)
        assert outcome(points, keep).status is IMPOSSIBLE
        wish = KeepDistance(SHOULD, metres=3.0, region=KITCHEN)
        assert outcome(points, wish).status is VIOLATED
    out = [(6.25, 6.25), (6.25, 0.25), (18.75, 0.25)]
    assert outcome(out, KeepDistance(SHOULD, metres=1.0, region=KITCHEN)).status is AS_FAR


def test_what_lies_at_the_ends_does_not_lower_the_greatest_distance():
    """From a niche 0.5 m wide, through a gap of 2 m: 0.75 m is possible there."""
    walls = [(0.0, 9.0, 1.0, 11.0), (1.5, 9.0, 2.5, 11.0), (9.0, 0.0, 10.0, 9.0),
             (9.0, 11.0, 10.0, 20.0)]  # fmt: skip
    costmap, keep = field(walls=walls), KeepDistance(metres=1.5)
    middle = [(1.25, 11.25), (1.25, 14.25), (6.25, 14.25), (7.75, 9.75), (18.75, 9.75)]
    found = outcome(middle, keep, costmap=costmap)
    assert found.status is AS_FAR
    assert found.detail == '0.8 m of 1.5 m, the most that passes, at 10.0, 9.8'
    aside = [(1.25, 11.25), (1.25, 14.25), (6.25, 14.25), (9.25, 9.25), (18.75, 9.75)]
    assert outcome(aside, keep, costmap=costmap).status is VIOLATED


def test_a_distance_to_a_place_may_be_kept_beside_it():
    costmap = field(walls=[(4.0, 9.5, 8.0, 20.0)])
    less = KeepDistance(metres=2.7, region=KITCHEN)
    points = [(1.25, 15.25), (1.25, 1.25), (18.75, 1.25)]
    assert outcome(points, less, costmap=costmap).status is SATISFIED


def test_walls_are_not_inflated_and_unknown_cells_are_none():
    cells = np.zeros((40, 40), np.int8)
    cells[20, 10:30], cells[4, 10:30] = 100, -1
    costmap = Costmap(GridMap(cells, 0.5), CostmapConfig(robot_radius=0.6, inflation_radius=2.0))
    points = [(1.25, 6.25), (18.75, 6.25)]
    assert outcome(points, KeepDistance(metres=3.75), costmap=costmap).status is SATISFIED
    found = outcome(points, KeepDistance(metres=4.0), costmap=costmap)
    assert found.measured == pytest.approx(0.25)


@pytest.mark.parametrize(
    ('points', 'status'),
    [
        ([(1, 10), (10, 18), (19, 10)], SATISFIED),
        ([(1, 10), (10, 17), (10, 18), (10, 17.5), (19, 10)], SATISFIED),
        ([(1, 10), (10, 18), (1, 11), (10, 2), (19, 10)], VIOLATED),
        ([(1, 18), (10, 18), (1, 17)], VIOLATED),
        ([(10, 18), (19, 18)], VIOLATED),
        ([(10, 2), (1, 2), (1, 18), (19, 18)], SATISFIED),
        ([(1, 10), (10, 2), (1, 9), (10, 18), (19, 10)], VIOLATED),
        ([(1, 14), (19, 14)], VIOLATED),
        ([(1, 14), (8.9, 15.9), (10.0, 16.05), (19, 17)], VIOLATED),
        ([(1, 14), (9, 16), (11, 16), (19, 17)], SATISFIED),
    ],
    ids=['over', 'along the ray', 'around', 'touches the ray', 'starts on the ray',
         'starts on the other ray', 'touches the other ray', 'through', 'cuts a corner', 'grazes'],
)  # fmt: skip
def test_pass_tells_crossing_from_touching(points, status):
    assert outcome(points, Pass(region=RACK, side='north')).status is status


def test_a_side_that_is_walled_up_is_proven_impossible():
    north, south = [(1.25, 10.25), (10.25, 18.25), (18.75, 10.25)], PAST
    closed = field(walls=[(9.0, 12.0, 11.0, 20.0)])
    shut = field(walls=[(9.0, 0.0, 11.0, 12.0), (9.0, 12.0, 11.0, 16.0)])
    found = outcome(south, Pass(region=RACK, side='north'), costmap=closed)
    assert found.status is IMPOSSIBLE
    assert outcome(south, Pass(region=RACK, side='south'), costmap=closed).status is SATISFIED
    assert outcome(north, Pass(region=RACK, side='south'), costmap=shut).status is IMPOSSIBLE
    assert outcome(south, Pass(region=RACK, side='north')).status is VIOLATED


def test_rays_through_the_centres_of_cells_are_no_leak():
    """On maps with a cell a metre, the ray from a wall runs over the centres of cells."""
    cells = np.zeros((21, 21), np.int8)
    cells[5:21, 10] = 100
    costmap = Costmap(GridMap(cells, 1.0, Pose2D(-0.5, -0.5)))
    places = Places([Place('wall', shapely.box(9.5, 4.5, 10.5, 20.5), 'object')])
    points = [(2.0, 10.0), (10.0, 2.0), (18.0, 10.0)]
    passed = Pass(region=NamedPlace('wall'), side='south')
    assert outcome(points, passed, costmap=costmap, places=places).status is SATISFIED
    other = Pass(region=NamedPlace('wall'), side='north')
    assert outcome(points, other, costmap=costmap, places=places).status is IMPOSSIBLE


def test_halves_and_sides_follow_the_compass_of_the_map_frame():
    for yaw in (0.0, math.pi / 2, math.pi, -0.4):
        origin = Pose2D(5.0, -3.0, yaw)
        costmap = field(origin=origin)
        centre = turned([(10.0, 10.0)], yaw, origin[:2])[0]
        north = [centre + (-4.0, 3.0), centre + (4.0, 3.0)]
        south = [centre + (-4.0, -3.0), centre + (4.0, -3.0)]
        half = StayIn(region=Half('north'))
        assert outcome(north, half, costmap=costmap).status is SATISFIED
        assert outcome(south, half, costmap=costmap).status is not SATISFIED
        places = Places([Place('it', shapely.Point(*centre).buffer(1.0))])
        passed = Pass(region=NamedPlace('it'), side='north')
        assert outcome(north, passed, costmap=costmap, places=places).status is SATISFIED
        assert outcome(south, passed, costmap=costmap, places=places).status is VIOLATED


def test_left_and_right_are_those_of_the_direct_way():
    way = [(1.25, 1.25), (1.25, 18.75), (18.75, 18.75)]
    assert outcome(way, StayIn(region=Half('left'))).status is SATISFIED
    assert outcome(way, Avoid(region=Half('right'))).status is SATISFIED
    assert outcome(way, Avoid(region=Half('left'))).status is VIOLATED
    assert outcome(way, StayIn(region=Half('right'))).status is VIOLATED
    passed = [(1.25, 10.25), (10.0, 18.25), (18.75, 10.25)]
    assert outcome(passed, Pass(region=RACK, side='left')).status is SATISFIED
    assert outcome(passed, Pass(region=RACK, side='right')).status is VIOLATED
    assert outcome(passed[::-1], Pass(region=RACK, side='right')).status is SATISFIED


def test_a_gap_and_a_strip_leave_out_the_places_themselves():
    gap = Between('kitchen', 'lab')
    assert outcome(THROUGH, Avoid(region=gap)).measured == pytest.approx(4.0, abs=1e-4)
    assert outcome(THROUGH, Visit(regions=(gap,))).status is SATISFIED
    assert outcome([(1.0, 2.0), (19.0, 2.0)], Visit(regions=(gap,))).status is VIOLATED
    strip = Along('kitchen', 1.0)
    found = outcome(THROUGH, Avoid(region=strip))
    assert found.measured == pytest.approx(2.0, abs=1e-4)
    assert outcome([(1.0, 3.5), (19.0, 3.5)], Visit(regions=(strip,))).status is SATISFIED
    half = Half('south', 'kitchen')
    assert outcome(THROUGH, Avoid(region=half)).status is SATISFIED
    assert outcome([(1.0, 5.9), (19.0, 5.9)], Avoid(region=half)).status is VIOLATED


def test_a_strip_along_the_walls_is_measured_from_their_cells():
    costmap = field(walls=[(0.0, 0.0, 20.0, 0.5)])
    near, far = [(1.25, 1.25), (18.75, 1.25)], [(1.25, 2.25), (18.75, 2.25)]
    strip = Along('walls', 1.0)
    assert outcome(near, StayIn(region=strip), costmap=costmap).status is SATISFIED
    assert outcome(far, Avoid(region=strip), costmap=costmap).status is SATISFIED
    assert outcome(near, Avoid(region=strip), costmap=costmap).status is IMPOSSIBLE
    assert outcome(near, Visit(regions=(strip,)), costmap=costmap).status is SATISFIED
    assert outcome(far, Visit(regions=(strip,)), costmap=costmap).status is VIOLATED


def test_margins_and_distances_add_to_a_strip_along_the_walls():
    costmap = field(walls=[(0.0, 0.0, 20.0, 0.5)])
    points = [(1.25, 2.75), (18.75, 2.75)]
    strip = Along('walls', 1.0)

    def status(clause):
        return outcome(points, clause, costmap=costmap).status

    assert status(Avoid(region=strip, margin=1.25)) is SATISFIED
    assert status(Avoid(region=strip, margin=1.26)) is IMPOSSIBLE
    assert status(KeepDistance(metres=1.25, region=strip)) is SATISFIED
    assert status(KeepDistance(metres=1.4, region=strip)) is VIOLATED
    assert status(EndAt(region=Along('walls', 2.25))) is SATISFIED
    assert status(EndAt(region=Along('walls', 2.2))) is VIOLATED
    assert status(Pass(region=strip, side='north')) is NOT_UNDERSTOOD


def test_a_strip_along_no_walls_is_not_understood():
    for clause in (Avoid(region=Along('walls', 1.0)), StayIn(region=Along('walls', 1.0))):
        assert outcome(PAST, clause).status is NOT_UNDERSTOOD
    assert outcome(PAST, KeepDistance(metres=1.0)).status is SATISFIED


def test_where_to_end_is_free_for_what_is_least():
    costmap = field(walls=[(9.0, 0.0, 10.0, 20.0)])
    points = [(1.25, 1.25), (6.25, 1.25)]
    end, avoid = outcomes(
        points, EndAt(region=Box(0.0, 0.0, 8.0, 2.0)), Avoid(region=KITCHEN), costmap=costmap
    )
    assert (end.status, avoid.status) == (SATISFIED, SATISFIED)
    goal = costmap.grid_map.world_to_cell(18.75, 1.25)
    aside = Route(costmap, costmap.grid_map.world_to_cell(1.25, 1.25), goal, PLACES)
    through = Specification((EndAt(region=Box(0.0, 0.0, 8.0, 2.0)), Avoid(region=KITCHEN)))
    found = verify(through, [(1.25, 1.25), (6.25, 6.25), (6.25, 1.25)], aside)
    assert [one.status for one in found] == [SATISFIED, VIOLATED]


def test_a_guess_and_a_name_that_is_missing_are_never_claimed():
    clauses = [
        Visit(regions=(KITCHEN,), unsure='?'), StayIn(region=LAB, unsure='?'),
        Visit(regions=(NamedPlace('attic'),), unsure='?'),
        Before(first=KITCHEN, second=NamedPlace('attic')),
        Visit(regions=(KITCHEN, NamedPlace('attic'))), EndAt(region=Between('attic', 'lab')),
        KeepDistance(metres=1.0, region=Along('attic', 1.0)), Pass(region=Half('left', 'attic')),
    ]  # fmt: skip
    statuses = [one.status for one in outcomes(THROUGH, *clauses)]
    assert statuses == [UNSURE, UNSURE, *[NOT_UNDERSTOOD] * 6]


def test_names_are_found_by_alias_in_any_case():
    assert outcome(THROUGH, Avoid(region=NamedPlace('Cook Room'))).status is VIOLATED


def test_nothing_asked_is_nothing_found():
    assert verify(NOTHING_ASKED, PAST, route(field(), PAST)) == ()


def test_the_check_knows_nothing_of_the_enforcement():
    allowed = {'outcome', 'route', 'regions', 'clauses', 'specification', 'verification'}
    for path in Path(verification.__file__).parent.glob('*.py'):
        for node in ast.walk(ast.parse(path.read_text(encoding='utf-8'))):
            if isinstance(node, ast.ImportFrom) and 'planner.instructions.' in node.module:
                assert node.module.split('.')[2] in allowed
            if isinstance(node, ast.ImportFrom) and 'planner.search' in node.module:
                assert node.module.split('.')[2] in {'_kernels', 'result'}
            assert not (isinstance(node, ast.Attribute) and node.attr == 'ask')


def test_every_kind_of_clause_has_its_check_under_its_own_name():
    for kind in CLAUSES.values():
        name = kind.__module__.rpartition('.')[2]
        assert callable(import_module(f'{verification.__name__}.{name}').check)


def test_a_point_without_a_radius_is_a_metre_to_avoid_and_half_a_metre_to_visit():
    point = Disc(10.0, 10.0)

    def status(y, clause):
        return outcome([(1.0, y), (19.0, y)], clause).status

    assert status(11.0, Avoid(region=point)) is SATISFIED
    assert status(10.9, Avoid(region=point)) is VIOLATED
    assert status(9.5, Visit(regions=(point,))) is SATISFIED
    assert status(9.4, Visit(regions=(point,))) is VIOLATED
    ended = [(1.0, 1.0), (10.0, 7.6)]
    assert outcome(ended, EndAt(region=Disc(10.0, 10.0, 2.4))).status is SATISFIED
    assert outcome(ended, EndAt(region=Disc(10.0, 10.0, 2.3))).status is VIOLATED


def test_the_nearest_wall_is_not_always_that_with_the_nearest_centre():
    costmap = field(1.0, walls=[(15.0, 10.0, 16.0, 11.0), (14.0, 13.0, 15.0, 14.0)])
    away = Walls(costmap).zone(0.0).distance(shapely.Point(10.55, 10.5))
    assert away == pytest.approx(math.hypot(3.45, 2.5))


def test_a_slow_curve_is_not_taken_for_a_straight_line():
    x = np.arange(1.0, 19.0, 0.05)
    curve = np.column_stack((x, 3.9 + 0.2 * np.sin(np.pi * (x - 1.0) / 18.0)))
    found = outcome(curve, Avoid(region=KITCHEN))
    assert found.status is VIOLATED
    assert found.measured == pytest.approx(8.0 - x[(curve[:, 1] > 4.0)][0], abs=0.06)


def test_before_is_not_impossible_where_the_second_need_not_be_entered():
    costmap = field(walls=[(3.0, 3.0, 9.0, 9.0)])
    clause = Before(first=KITCHEN, second=LAB)
    points = [(1.25, 1.25), (14.25, 6.25), (18.75, 1.25)]
    assert outcome(points, clause, costmap=costmap).status is VIOLATED


@pytest.mark.parametrize(('cutting', 'status'), [(False, IMPOSSIBLE), (True, VIOLATED)])
def test_whether_corners_may_be_cut_decides_what_can_be_reached(cutting, status):
    walls = [(0.0, 10.0, 10.0, 11.0), (10.0, 11.0, 20.0, 12.0)]
    costmap = field(1.0, walls=walls, corner_cutting=cutting)
    assert outcome(PAST, Visit(regions=(Disc(5.5, 15.5),)), costmap=costmap).status is status
    passed = Avoid(region=Box(0.0, 0.0, 20.0, 10.0), unsure='?')
    assert outcome(PAST, passed, costmap=costmap).status is UNSURE
