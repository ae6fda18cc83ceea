"""Paths that satisfy and paths that violate, by little and by much, for each clause and region."""

import pytest
from llm_astar_planner.instructions.specification import (
    SHOULD,
    Avoid,
    Before,
    Box,
    Disc,
    EndAt,
    Half,
    KeepDistance,
    NamedPlace,
    Pass,
    StayIn,
    Tagged,
    Unknown,
    Visit,
)
from verified_maps import (
    GUESSED,
    IMPOSSIBLE,
    NOT_UNDERSTOOD,
    SATISFIED,
    VIOLATED,
    field,
    outcome,
    outcomes,
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


def test_who_starts_inside_may_leave_by_the_shortest_way():
    out = [(6.25, 6.25), (6.25, 1.25), (18.75, 1.25)]
    across = [(6.25, 6.25), (18.75, 6.25)]
    along = [(6.25, 6.25), (6.25, 5.25), (4.25, 5.25), (4.25, 7.75), (2.25, 7.75), (18.75, 1.25)]
    assert outcome(out, Avoid(region=KITCHEN)).status is SATISFIED
    assert outcome(across, Avoid(region=KITCHEN)).status is SATISFIED
    found = outcome(along, Avoid(region=KITCHEN))
    assert found.status is VIOLATED
    assert found.least == pytest.approx(1.75, abs=0.01)


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
    assert outcome(start_in_the_north, south).status is SATISFIED
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


def test_a_guessed_clause_is_never_satisfied():
    assert outcome(PAST, Avoid(region=KITCHEN, guessed=True)).status is GUESSED


def test_before_looks_at_the_first_entry():
    clause = Before(first=LAB, second=KITCHEN)
    assert outcome(PAST, clause).status is SATISFIED
    assert outcome(THROUGH[::-1], clause).status is SATISFIED
    assert outcome(THROUGH, clause).status is VIOLATED


def test_end_at_looks_at_the_last_point():
    assert outcome([(1.25, 1.25), (6.25, 6.25)], EndAt(region=KITCHEN)).status is SATISFIED
    assert outcome(THROUGH, EndAt(region=KITCHEN)).status is VIOLATED
