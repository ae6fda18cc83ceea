"""Paths that keep and that violate what is asked of order and number, by little and by much."""

import math

import pytest
import shapely
from llm_astar_msgs_adapter.maps.places import Place, Places
from llm_astar_planner.instructions.clauses.before import Before
from llm_astar_planner.instructions.clauses.clause import SHOULD
from llm_astar_planner.instructions.clauses.count import Count
from llm_astar_planner.instructions.clauses.never_after import NeverAfter
from llm_astar_planner.instructions.clauses.then import Then
from llm_astar_planner.instructions.clauses.visit import Visit
from llm_astar_planner.instructions.regions import Along, Box, Disc, NamedPlace, Tagged
from verified_maps import (
    AS_FAR,
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
KITCHEN_THEN_LAB = Then(first=KITCHEN, second=LAB)
# North of the kitchen, through it to the south, and on to the east.
DOWN = [(6.25, 10.25), (6.25, 1.25), (18.75, 1.25)]


def test_who_does_not_enter_the_first_owes_nothing():
    found = outcome(PAST, KITCHEN_THEN_LAB)
    assert (found.status, found.detail) == (SATISFIED, 'the first is not entered')
    assert outcome([(1.0, 4.0), (19.0, 4.0)], KITCHEN_THEN_LAB).status is SATISFIED


def test_who_enters_the_first_visits_the_second_afterwards():
    found = outcome(THROUGH, KITCHEN_THEN_LAB)
    assert found.status is SATISFIED
    assert found.detail == '12.5, 6.2 is reached after 8.0, 6.2'
    found = outcome(THROUGH[::-1], KITCHEN_THEN_LAB)
    assert found.status is VIOLATED
    assert found.detail == 'the second is not visited after the first is last left, at 4.0, 6.2'
    assert found.where == pytest.approx((4.0, 6.25), abs=1e-4)
    assert found.measured == pytest.approx(8.5, abs=1e-4)


def test_a_cut_corner_of_the_first_is_an_entry():
    after = [(14.0, 6.0), (8.0, 3.0), (3.51, 4.51), (4.51, 3.51)]
    assert outcome(after, KITCHEN_THEN_LAB).status is VIOLATED
    assert (
        outcome([*after[:2], (3.0, 3.0), (3.49, 4.5), (4.5, 3.49)], KITCHEN_THEN_LAB).status
        is SATISFIED
    )


@pytest.mark.parametrize(('y', 'status'), [(4.49, VIOLATED), (4.5, SATISFIED)])
def test_the_second_is_visited_as_deep_as_any_visit(y, status):
    assert outcome([(6.0, 6.0), (10.0, y), (19.0, y)], KITCHEN_THEN_LAB).status is status


def test_every_entry_of_the_first_counts():
    again = [*THROUGH, (18.75, 10.25), (6.25, 10.25), (6.25, 7.75), (6.25, 10.25)]
    assert outcome(again, KITCHEN_THEN_LAB).status is VIOLATED
    assert outcome([*again, (14.25, 10.25), (14.25, 7.25)], KITCHEN_THEN_LAB).status is SATISFIED


def test_the_second_counts_at_once_where_both_overlap():
    inner = Box(5.0, 5.0, 7.0, 7.0)
    inside = [(1.25, 6.25), (6.25, 6.25)]
    assert outcome(inside, Then(first=KITCHEN, second=inner)).status is SATISFIED
    assert outcome(THROUGH, Then(first=inner, second=KITCHEN)).status is SATISFIED
    # Past the inner part it is in the kitchen again, and owes another visit.
    assert outcome(THROUGH, Then(first=KITCHEN, second=inner)).status is VIOLATED


def test_an_object_is_entered_and_visited_within_a_metre():
    near, far = [(8.1, 1.0), (8.1, 19.0)], [(7.9, 1.0), (7.9, 19.0)]
    clause = Then(first=RACK, second=LAB)
    assert outcome(near, clause).status is VIOLATED
    assert outcome(far, clause).status is SATISFIED
    assert outcome([(14.0, 6.0), *near], Then(first=LAB, second=RACK)).status is SATISFIED
    assert outcome([(14.0, 6.0), *far], Then(first=LAB, second=RACK)).status is VIOLATED


def test_what_was_owed_on_the_way_driven_is_still_owed():
    assert outcome(PAST, KITCHEN_THEN_LAB, driven=THROUGH[::-1]).status is VIOLATED
    assert outcome(PAST, KITCHEN_THEN_LAB, driven=[*THROUGH, *PAST]).status is SATISFIED
    found = outcome([(10.0, 6.0), (19.0, 6.0)], KITCHEN_THEN_LAB, driven=[(1.0, 6.0), (9.0, 6.0)])
    assert found.status is SATISFIED
    assert found.detail == '12.5, 6.0 is reached after 8.0, 6.0 on the way driven'


def test_it_is_proven_that_nothing_can_follow():
    filled = field(walls=[(11.0, 3.0, 17.0, 9.0)])
    gate = Box(9.0, -math.inf, 10.0, math.inf)
    assert outcome(PAST, Then(first=gate, second=LAB), costmap=filled).status is IMPOSSIBLE
    # There is a way around the kitchen.
    assert outcome(DOWN, KITCHEN_THEN_LAB, costmap=filled).status is VIOLATED
    assert outcome(PAST, Then(first=gate, second=LAB)).status is VIOLATED
    west = Box(1.0, 15.0, 2.0, 16.0)
    # Only before the gate, only beyond it: who stays behind it cannot reach the goal.
    shut = field(walls=[(9.0, 5.0, 10.0, 20.0)])
    assert outcome(PAST, Then(first=gate, second=west), costmap=shut).status is IMPOSSIBLE
    assert outcome(PAST, Then(first=gate, second=LAB), costmap=shut).status is VIOLATED


def test_who_ends_in_the_first_ends_in_the_second_too_or_breaks_it():
    ended = [(1.25, 1.25), (6.25, 6.25)]
    assert outcome(ended, KITCHEN_THEN_LAB).status is IMPOSSIBLE
    part = Then(first=KITCHEN, second=Disc(6.25, 6.25, 0.5))
    assert outcome(ended, part).status is SATISFIED
    other = Then(first=KITCHEN, second=Disc(4.75, 4.75, 0.25))
    assert outcome(ended, other).status is IMPOSSIBLE


NOT_LAB_AFTER_KITCHEN = NeverAfter(first=KITCHEN, second=LAB)


def test_the_second_is_not_entered_after_the_first():
    found = outcome(THROUGH, NOT_LAB_AFTER_KITCHEN)
    assert found.status is VIOLATED
    assert found.detail == 'entered at 12.0, 6.2, after the first at 4.0, 6.2'
    assert found.measured == pytest.approx(4.0, abs=1e-4)
    assert found.where == pytest.approx((12.0, 6.25), abs=1e-4)
    assert outcome(THROUGH[::-1], NOT_LAB_AFTER_KITCHEN).status is SATISFIED
    assert outcome(PAST, NOT_LAB_AFTER_KITCHEN).status is SATISFIED


@pytest.mark.parametrize(('y', 'status'), [(8.0, SATISFIED), (7.999, VIOLATED)])
def test_entering_is_enough_however_short(y, status):
    points = [(6.0, 6.0), (6.0, 9.0), (12.0, y), (16.0, 9.0)]
    assert outcome(points, NOT_LAB_AFTER_KITCHEN).status is status


def test_what_is_in_both_is_in_the_second_after_the_first():
    half = Box(6.0, 4.0, 9.0, 8.0)
    assert outcome(THROUGH, NeverAfter(first=KITCHEN, second=half)).status is VIOLATED
    assert outcome(THROUGH[::-1], NeverAfter(first=KITCHEN, second=half)).status is VIOLATED
    beside = Box(8.0, 4.0, 9.0, 8.0)
    assert outcome(THROUGH[::-1], NeverAfter(first=KITCHEN, second=beside)).status is SATISFIED
    assert outcome(THROUGH, NeverAfter(first=KITCHEN, second=beside)).status is VIOLATED
    assert outcome(PAST, NeverAfter(first=KITCHEN, second=KITCHEN)).status is SATISFIED


def test_what_was_entered_on_the_way_driven_closes_the_second():
    east = [(10.0, 6.0), (18.75, 6.0)]
    assert outcome(east, NOT_LAB_AFTER_KITCHEN).status is SATISFIED
    found = outcome(east, NOT_LAB_AFTER_KITCHEN, driven=[(1.0, 6.0), (9.0, 6.0)])
    assert found.status is VIOLATED
    assert found.detail == 'entered at 12.0, 6.0, after the first at 4.0, 6.0 on the way driven'
    driven = outcome(PAST, NOT_LAB_AFTER_KITCHEN, driven=THROUGH)
    assert driven.status is VIOLATED
    assert '12.0, 6.2 on the way driven' in driven.detail


def test_it_is_proven_that_the_second_follows():
    shut = field(walls=[(9.0, 5.0, 10.0, 20.0)])
    gate, beyond = Box(9.0, 0.0, 10.0, 5.0), Box(15.0, -math.inf, 16.0, math.inf)
    clause = NeverAfter(first=gate, second=beyond)
    assert outcome(PAST, clause, costmap=shut).status is IMPOSSIBLE
    assert outcome(PAST, clause).status is VIOLATED
    assert outcome(PAST, NeverAfter(first=beyond, second=gate), costmap=shut).status is SATISFIED
    assert outcome(THROUGH, NOT_LAB_AFTER_KITCHEN).status is VIOLATED
    inside = [(6.25, 6.25), (14.25, 6.25)]
    assert outcome(inside, NOT_LAB_AFTER_KITCHEN).status is IMPOSSIBLE


def loops(count, y=6.25):
    """A path that is in the kitchen so many times, and each time 2 m away from it again."""
    points = [(1.25, y)]
    for _ in range(count):
        points += [(6.25, y), (1.25, y)]
    return [*points, (1.25, 18.75)]


@pytest.mark.parametrize('times', range(5))
def test_entries_are_counted(times):
    for least in range(5):
        for most in (*range(least, 5), None):
            found = outcome(loops(times), Count(region=KITCHEN, at_least=least, at_most=most))
            is_kept = least <= times and (most is None or times <= most)
            assert (found.status is SATISFIED) is is_kept, found.detail


def test_the_count_is_told_with_its_places():
    assert outcome(PAST, Count(region=KITCHEN)).detail == 'not entered'
    found = outcome(THROUGH, Count(region=KITCHEN, at_most=2))
    assert found.detail == 'entered once, at 4.5, 6.2'
    found = outcome(loops(2), Count(region=KITCHEN, at_most=1))
    assert found.status is VIOLATED
    assert found.detail == 'entered 2 times, at 4.5, 6.2 and 4.5, 6.2'
    assert found.where == pytest.approx((4.5, 6.25), abs=1e-4)


@pytest.mark.parametrize(('x', 'times'), [(3.26, 1), (3.24, 2)])
def test_who_goes_less_than_one_and_a_half_cells_away_has_not_left(x, times):
    points = [(1.25, 6.25), (6.25, 6.25), (x, 6.25), (6.25, 6.25)]
    assert (
        outcome(points, Count(region=KITCHEN, at_least=times, at_most=times)).status is SATISFIED
    )


@pytest.mark.parametrize(('y', 'times'), [(4.49, 0), (4.51, 1)])
def test_an_entry_goes_as_deep_as_a_visit(y, times):
    points = [(1.0, y), (19.0, y)]
    assert (
        outcome(points, Count(region=KITCHEN, at_least=times, at_most=times)).status is SATISFIED
    )


def test_who_only_touches_the_depth_of_a_visit_may_have_entered_or_not():
    corner = [(3.5, 5.5), (5.5, 3.5)]
    for least, most in ((0, 0), (1, 1), (1, None)):
        found = outcome(corner, Count(region=KITCHEN, at_least=least, at_most=most))
        assert found.status is SATISFIED
    deeper = [(3.51, 5.51), (5.51, 3.51)]
    assert outcome(deeper, Count(region=KITCHEN, at_most=0)).status is VIOLATED


def test_who_begins_inside_has_entered():
    out = [(6.25, 6.25), (6.25, 1.25)]
    assert outcome(out, Count(region=KITCHEN, at_least=1, at_most=1)).status is SATISFIED
    assert outcome(out, Count(region=KITCHEN, at_most=0)).status is IMPOSSIBLE
    back = [*out, (6.25, 6.25)]
    assert outcome(back, Count(region=KITCHEN, at_least=2)).status is SATISFIED


def test_entries_of_several_places_and_of_objects():
    blue = Count(region=Tagged('blue'), at_least=2, at_most=2)
    assert outcome(THROUGH, blue).status is SATISFIED
    close = Places([Place(name, shapely.box(x, 4.0, x + 4.0, 8.0), 'room', (), ('blue',))
                    for name, x in (('one', 4.0), ('two', 9.0))])  # fmt: skip
    once = Count(region=Tagged('blue'), at_least=1, at_most=1)
    assert outcome(THROUGH, once, places=close).status is SATISFIED
    rack = Count(region=RACK, at_least=2, at_most=2)
    points = [(8.1, 14.0), (7.0, 14.0), (8.1, 14.0)]
    assert outcome(points, rack).status is SATISFIED
    points = [(8.1, 14.0), (7.5, 14.0), (8.1, 14.0)]
    assert outcome(points, rack).status is VIOLATED


def test_entries_on_the_way_driven_count():
    once = Count(region=KITCHEN, at_least=1, at_most=1)
    assert outcome(PAST, once).status is VIOLATED
    assert outcome(PAST, once, driven=THROUGH).status is SATISFIED
    # A new plan from within is no new entry.
    inside = [(6.25, 6.25), (18.75, 6.25)]
    assert outcome(inside, once, driven=[(1.25, 6.25), (6.25, 6.25)]).status is SATISFIED
    found = outcome(THROUGH, once, driven=[*THROUGH, *PAST[::-1]])
    assert found.status is VIOLATED
    assert found.detail == 'entered 2 times, at 4.5, 6.2 on the way driven and 4.5, 6.2'


def test_it_is_proven_how_often_one_has_to_enter():
    shut = field(walls=[(9.0, 5.0, 10.0, 20.0)])
    gate = Box(8.0, -math.inf, 11.0, 7.0)
    assert outcome(PAST, Count(region=gate, at_most=0), costmap=shut).status is IMPOSSIBLE
    assert outcome(PAST, Count(region=gate, at_most=1), costmap=shut).status is SATISFIED
    assert outcome(PAST, Count(region=gate, at_most=0)).status is VIOLATED
    wish = Count(SHOULD, region=gate, at_most=0)
    found = outcome(PAST, wish, costmap=shut)
    assert found.status is AS_FAR
    assert found.detail == 'entered once, at 8.5, 1.2, the least possible'
    assert outcome(loops(1), Count(SHOULD, region=KITCHEN, at_most=0)).status is VIOLATED
    stripes = Places([Place(name, shapely.box(x, -1.0, x + 1.5, 21.0), 'room', (), ('stripe',))
                      for name, x in (('one', 4.0), ('two', 9.0), ('three', 14.0))])  # fmt: skip
    three = Tagged('stripe')
    for most, status in ((3, SATISFIED), (2, IMPOSSIBLE)):
        found = outcome(PAST, Count(region=three, at_most=most), places=stripes)
        assert found.status is status
    filled = field(walls=[(3.0, 3.0, 9.0, 9.0)])
    found = outcome(PAST, Count(region=KITCHEN, at_least=1), costmap=filled)
    assert (found.status, found.detail) == (IMPOSSIBLE, 'no free cell of it can be reached')


def test_nothing_is_claimed_of_the_order_of_what_does_not_exist():
    attic = NamedPlace('attic')
    clauses = [
        Then(first=attic, second=LAB), Then(first=LAB, second=attic), Count(region=attic),
        NeverAfter(first=attic, second=LAB), NeverAfter(first=LAB, second=attic),
        Before(first=attic, second=LAB), Count(region=Box(3.0, 3.0, 3.0, 8.0)),
    ]  # fmt: skip
    assert {one.status for one in outcomes(PAST, *clauses)} == {NOT_UNDERSTOOD}


def test_a_strip_along_the_walls_may_be_entered_once():
    costmap = field(walls=[(0.0, 0.0, 20.0, 0.5)])
    strip = Along('walls', 1.0)
    dip = [(1.25, 3.25), (6.25, 1.25), (18.75, 3.25)]
    assert outcome(dip, Count(region=strip, at_least=1, at_most=1), costmap=costmap).status is (
        SATISFIED
    )
    assert outcome(dip, Then(first=strip, second=LAB), costmap=costmap).status is VIOLATED
    assert outcome(dip, NeverAfter(first=strip, second=LAB), costmap=costmap).status is SATISFIED
    assert outcome(dip, Before(first=LAB, second=strip), costmap=costmap).status is VIOLATED


def test_a_round_that_is_driven_twice_is_visits_in_order():
    rounds = [Visit(regions=(place,)) for place in (KITCHEN, LAB) * 2]
    assert [one.status for one in outcomes(THROUGH, *rounds)][2] is VIOLATED
    twice = outcomes([*THROUGH, *THROUGH], *rounds)
    assert {one.status for one in twice} == {SATISFIED}
