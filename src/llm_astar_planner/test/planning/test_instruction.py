import numpy as np
import pytest
import shapely
from llm_astar_msgs_adapter.maps.grid_map import GridMap
from llm_astar_msgs_adapter.maps.places import Place, Places
from llm_astar_planner.costmap.config import CostmapConfig
from llm_astar_planner.instructions.clauses.avoid import Avoid
from llm_astar_planner.instructions.clauses.before import Before
from llm_astar_planner.instructions.clauses.clause import MUST, SHOULD
from llm_astar_planner.instructions.clauses.count import Count
from llm_astar_planner.instructions.clauses.end_at import EndAt
from llm_astar_planner.instructions.clauses.keep_distance import KeepDistance
from llm_astar_planner.instructions.clauses.never_after import NeverAfter
from llm_astar_planner.instructions.clauses.pass_by import Pass
from llm_astar_planner.instructions.clauses.stay_in import StayIn
from llm_astar_planner.instructions.clauses.then import Then
from llm_astar_planner.instructions.clauses.unknown import Unknown
from llm_astar_planner.instructions.clauses.visit import Visit
from llm_astar_planner.instructions.interpretation import (
    Interpretation,
    RouteInstruction,
    Understanding,
    status_of,
)
from llm_astar_planner.instructions.outcome import ClauseStatus
from llm_astar_planner.instructions.regions import Box, Disc, End, Half, NamedPlace
from llm_astar_planner.instructions.specification import Specification
from llm_astar_planner.instructions.text import REQUIRE
from llm_astar_planner.planning import instruction as instruction_module
from llm_astar_planner.planning.compile import compile_instruction_kernels
from llm_astar_planner.planning.plan_reuse import way_of
from llm_astar_planner.planning.planner import Planner
from llm_astar_planner.planning.types import PlanningFailure, PlanRequest, ResultCode

# Metres and cells: 40 x 24 cells of 0.5 m. Two rooms in the north, open to the hall by a door
# each and to each other by a third; a rack stands in the hall.
RESOLUTION = 0.5
WEST, EAST, SAFE = NamedPlace('west room'), NamedPlace('east room'), NamedPlace('safe')
RACK = NamedPlace('rack')


def rooms():
    cells = np.zeros((24, 40), dtype=np.int8)
    cells[12, :] = 100
    cells[12, 8:10] = cells[12, 30:32] = 0
    cells[12:, 20] = 100
    cells[17:19, 20] = 0
    cells[5:7, 15:25] = 100
    cells[20:23, 35:38] = 100  # the safe
    return GridMap(cells, RESOLUTION)


PLACES = Places(
    [
        Place('west room', shapely.box(0, 6.5, 10, 12), 'room'),
        Place('east room', shapely.box(10.5, 6.5, 20, 12), 'room'),
        Place('rack', shapely.box(7.5, 2.5, 12.5, 3.5), 'object'),
        Place('safe', shapely.box(17.5, 10, 19, 11.5)),
    ]
)
START, GOAL = (3, 6), (36, 6)


@pytest.fixture(scope='module')
def planner():
    compile_instruction_kernels()  # else a slow compilation counts as planning time
    return Planner(rooms()).prepare()


def instructed(*clauses, **changes):
    specification = Specification(clauses)
    status = changes.pop('status', status_of(specification))
    interpretation = Interpretation('text', specification, 'truth', status)
    return RouteInstruction(interpretation, PLACES, **changes)


def plan(planner, *clauses, start=START, goal=GOAL, policy='prefer', driven=(), **more):
    way = np.reshape(np.asarray(driven, dtype=np.float64), (-1, 2))
    instruction = instructed(*clauses, policy=policy, driven=way)
    return planner.plan(PlanRequest(start, goal, instruction=instruction, **more))


def line(planner, made):
    points = planner.grid_map.grid_to_world(made.path)
    return shapely.LineString(points if len(points) > 1 else np.repeat(points, 2, axis=0))


def inside(planner, made, name):
    return line(planner, made).intersection(PLACES.get(name).geometry).length


def statuses(made):
    return [outcome.status.value for outcome in made.instruction.clauses]


def test_an_avoided_place_is_not_entered_and_a_visited_one_is(planner):
    made = plan(planner, Visit(regions=(WEST,)))
    assert statuses(made) == ['kept']
    assert inside(planner, made, 'west room') > 0.5
    start = (3, 20)
    through = plan(planner, start=start, goal=(36, 15))
    assert inside(planner, through, 'east room') > 1.0
    round_it = plan(planner, Avoid(region=NamedPlace('safe')), start=start, goal=(36, 15))
    assert statuses(round_it) == ['kept']
    assert round_it.instruction.satisfied is True


@pytest.mark.parametrize('method', ['guided', 'exact_astar', 'llm_astar', 'astar'])
def test_every_method_keeps_to_what_is_closed(planner, method):
    door = Avoid(region=Disc(10.25, 9.0, 0.6))
    made = plan(planner, door, start=(3, 20), goal=(36, 15), method=method)
    assert statuses(made) == ['kept']
    assert made.path[:, 1].min() < 12


def test_the_bound_of_guided_holds_for_the_problem_with_the_instruction(planner):
    door = Avoid(region=Disc(10.25, 9.0, 0.6))
    ends = {'start': (3, 20), 'goal': (36, 15)}
    exact = plan(planner, door, method='exact_astar', **ends)
    guided = plan(planner, door, max_suboptimality=1.0, **ends)
    assert guided.cost == pytest.approx(exact.cost)
    assert guided.suboptimality_bound == pytest.approx(1.0)


def test_visits_are_made_in_their_order(planner):
    there_and_back = plan(planner, Visit(regions=(EAST,)), Visit(regions=(WEST,)))
    assert statuses(there_and_back) == ['kept', 'kept']
    in_any_order = plan(planner, Visit(regions=(EAST, WEST)))
    assert statuses(in_any_order) == ['kept']
    assert in_any_order.length < there_and_back.length
    assert there_and_back.suboptimality_bound == 1.0


def test_a_region_that_was_visited_on_the_way_is_not_visited_again(planner):
    there = PLACES.get('west room').geometry.centroid
    made = plan(planner, Visit(regions=(WEST,)), driven=[(there.x, there.y), (1.75, 3.25)])
    assert inside(planner, made, 'west room') == 0.0
    assert statuses(made) == ['kept']


def test_a_place_is_entered_only_after_another(planner):
    first_west = plan(planner, Before(first=WEST, second=EAST), goal=(30, 15))
    assert statuses(first_west) == ['kept']
    assert inside(planner, first_west, 'west room') > 1.0


@pytest.mark.parametrize('side', ['north', 'south'])
def test_an_object_is_passed_on_a_side(planner, side):
    made = plan(planner, Pass(region=RACK, side=side))
    assert statuses(made) == ['kept']
    x, y = line(planner, made).xy
    beside = np.interp(10.0, x, y)
    assert (beside > 3.5) == (side == 'north')


def test_half_of_the_map_and_distance(planner):
    south = plan(planner, StayIn(region=Half('south')), start=(3, 6), goal=(36, 6))
    assert statuses(south) == ['kept']
    distant = plan(planner, KeepDistance(metres=1.5, region=RACK))
    assert statuses(distant) == ['kept']
    assert line(planner, distant).distance(PLACES.get('rack').geometry) >= 1.5
    walls = plan(planner, KeepDistance(metres=1.0))
    assert statuses(walls) == ['kept']


def test_the_path_ends_where_a_clause_says(planner):
    made = plan(planner, EndAt(region=WEST))
    assert statuses(made) == ['kept']
    assert made.goal != GOAL
    assert made.path[-1].tolist() == list(made.goal)
    (warning,) = made.warnings
    assert 'as the instruction says, and does not pass the goal cell (36, 6)' in warning


def test_an_impossible_clause_is_said_and_the_path_comes_all_the_same(planner):
    made = plan(planner, Visit(regions=(SAFE,)), Visit(regions=(WEST,)))
    assert statuses(made) == ['impossible', 'kept']
    assert made.code is ResultCode.NONE
    walled_in = plan(planner, Avoid(region=Half('south')), start=(3, 20), goal=GOAL)
    assert statuses(walled_in) == ['impossible']  # the goal lies inside
    assert walled_in.code is ResultCode.NONE


def test_what_is_impossible_costs_nothing(planner):
    direct = planner.plan(PlanRequest((3, 20), GOAL))
    for clause in (
        Avoid(region=Half('south')),
        Avoid(region=Box(9.0, -1.0, 11.0, 20.0)),
        Visit(regions=(SAFE,)),
        Count(region=SAFE, at_least=1),
    ):
        made = plan(planner, clause, start=(3, 20))
        assert statuses(made) == ['impossible']
        assert made.length == pytest.approx(direct.length), clause


def test_of_a_distance_that_cannot_be_kept_the_greatest_is(planner):
    asked = plan(planner, KeepDistance(metres=5.0), start=(3, 20))
    (outcome,) = asked.instruction.clauses
    assert outcome.status in (ClauseStatus.IMPOSSIBLE, ClauseStatus.AS_FAR_AS_POSSIBLE)
    kept = outcome.clause.metres - outcome.measured
    possible = plan(planner, KeepDistance(metres=kept - 0.01), start=(3, 20))
    assert statuses(possible) == ['kept']
    more = plan(planner, KeepDistance(metres=kept + 0.2), start=(3, 20))
    assert statuses(more) != ['kept']


def test_clauses_about_the_order_of_entries(planner):
    then = plan(planner, Visit(regions=(WEST,)), Then(first=WEST, second=EAST))
    assert statuses(then) == ['kept', 'kept']
    assert inside(planner, then, 'east room') > 1.0
    untouched = plan(planner, Then(first=WEST, second=EAST))
    assert statuses(untouched) == ['kept']
    assert untouched.length == planner.plan(PlanRequest(START, GOAL)).length
    never = plan(planner, NeverAfter(first=EAST, second=WEST), Visit(regions=(WEST, EAST)))
    assert statuses(never) == ['kept', 'kept']
    twice = plan(planner, Count(region=WEST, at_least=2, at_most=2))
    assert statuses(twice) == ['kept']
    assert twice.length > plan(planner, Visit(regions=(WEST,))).length


def test_there_and_back(planner):
    made = plan(planner, Visit(regions=(End('goal'),)), EndAt(region=End('start')))
    assert statuses(made) == ['kept', 'kept']
    assert np.hypot(*np.subtract(made.goal, START)) <= 1.0  # half a metre
    assert made.warnings == ()  # it was at the goal
    assert made.length > 1.9 * planner.plan(PlanRequest(START, GOAL)).length - 2.0


def test_each_clause_has_its_price(planner):
    direct = planner.plan(PlanRequest(START, GOAL, method='exact_astar')).length
    made = plan(planner, Visit(regions=(WEST,)), Avoid(region=SAFE))
    visit, avoid = (outcome.price for outcome in made.instruction.clauses)
    assert visit == pytest.approx(0.5 * (made.length - direct))
    assert avoid == 0.0
    quiet = planner.plan(
        PlanRequest(START, GOAL, instruction=instructed(Visit(regions=(WEST,)), want_prices=False))
    )
    assert np.isnan(quiet.instruction.clauses[0].price)


def test_require_gives_no_path_that_breaks_a_must_clause(planner):
    impossible = plan(planner, Visit(regions=(SAFE,)), policy=REQUIRE)
    assert impossible.code is ResultCode.NO_VALID_PATH
    assert not len(impossible.path)
    unknown = plan(planner, Unknown(text='hm'), policy=REQUIRE)
    assert 'not understood' in unknown.message
    kept = plan(planner, Visit(regions=(WEST,)), policy=REQUIRE)
    assert kept.code is ResultCode.NONE
    for strength in (MUST, SHOULD):
        unsure = plan(planner, Visit(strength, 'that one?', regions=(WEST,)), policy=REQUIRE)
        assert unsure.code is ResultCode.NO_VALID_PATH
        assert 'that one?' in unsure.message


def test_a_should_clause_is_kept_where_it_can_be(planner):
    wish = Avoid(strength=SHOULD, region=Disc(10.25, 9.0, 0.6))
    made = plan(planner, wish, start=(3, 20), goal=(36, 15))
    assert statuses(made) == ['kept']


def test_a_guessed_clause_is_never_claimed(planner):
    made = plan(planner, Avoid(unsure='?', region=WEST))
    assert statuses(made) == ['unsure']
    assert made.instruction.satisfied is False


def test_a_clause_in_question_is_followed_only_where_it_costs_little(planner, monkeypatch):
    monkeypatch.setattr('llm_astar_planner.planning.instruction.UNSURE_SHARE', 0.1)
    direct = planner.plan(PlanRequest(START, GOAL)).length
    for unsure in (Visit(unsure='?', regions=(EAST,)), Avoid(unsure='?', region=Half('south'))):
        made = plan(planner, unsure)
        assert made.length == direct
        assert 'waits for the answer: it would be' in made.instruction.note
    nearby = plan(planner, Avoid(unsure='?', region=Disc(8.0, 3.0, 1.0)))
    assert nearby.instruction.note == ''


def test_clauses_that_exclude_each_other_are_named(planner):
    made = plan(planner, Visit(regions=(WEST,)), Avoid(region=WEST))
    assert made.instruction.note == '"visit the west room" contradicts "avoid the west room"'
    assert made.instruction.satisfied is False
    assert made.code is ResultCode.NONE


@pytest.mark.parametrize('status', [Understanding.PENDING, Understanding.IRRELEVANT])
def test_without_clauses_the_direct_path_comes(planner, status):
    direct = planner.plan(PlanRequest(START, GOAL))
    made = planner.plan(PlanRequest(START, GOAL, instruction=instructed(status=status)))
    assert made.length == direct.length
    assert made.instruction.summary() == status.value
    assert made.instruction.satisfied is (None if status is Understanding.IRRELEVANT else False)


def test_a_search_out_of_time_leaves_the_direct_path_and_says_so(planner, monkeypatch):
    def stopped(*_, **__):
        raise PlanningFailure(ResultCode.TIMEOUT, 'out of time')

    monkeypatch.setattr(instruction_module.InstructedSearch, 'search', stopped)
    made = plan(planner, Visit(regions=(WEST,)))
    assert made.code is ResultCode.NONE
    assert made.instruction.note == 'out of time: the direct path is taken'
    assert statuses(made) == ['not kept']


def test_an_instruction_does_not_bend_the_via_points_of_a_request(planner):
    made = plan(planner, Avoid(region=WEST), via=((5, 20),))
    assert statuses(made) == ['not kept']
    assert 'via points of its own' in made.instruction.note


def test_clauses_that_only_exclude_each_other_on_this_map_are_noted(planner):
    doors = [Avoid(region=Disc(x, 6.25, 0.8)) for x in (4.5, 15.5)]
    made = plan(planner, *doors, Visit(regions=(WEST,)))
    assert made.instruction.note == 'no path of cells keeps every clause'
    assert made.instruction.satisfied is False
    assert made.code is ResultCode.NONE


@pytest.mark.usefixtures('planner')
def test_a_path_at_any_angle_keeps_its_visits():
    planner = Planner(rooms(), CostmapConfig(robot_radius=0.25)).prepare()
    made = plan(planner, Visit(regions=(EAST,)), Visit(regions=(WEST,)), any_angle=True)
    assert statuses(made) == ['kept', 'kept']
    assert made.any_angle is not None
    assert made.any_angle.length < made.length


def test_the_answer_to_a_request_that_cannot_be_served_names_the_cause(planner):
    made = plan(planner, Visit(regions=(WEST,)), goal=(20, 12))
    assert made.code is ResultCode.GOAL_OCCUPIED
    assert made.instruction.note == 'there is no path'


@pytest.mark.parametrize('policy', ['prefer', 'require'])
@pytest.mark.parametrize('any_angle', [False, True])
def test_the_last_way_is_kept_while_it_keeps_to_the_instruction_as_well(
    planner, policy, any_angle
):
    more = {'any_angle': any_angle, 'smoothing': True, 'switch_margin': 0.05}
    clause = Pass(region=RACK, side='south')
    first = plan(planner, clause, policy=policy, **more)
    assert statuses(first) == ['kept']
    way = way_of(first, planner.costmap)
    start = tuple(way.cells[3].tolist())
    kept = plan(planner, clause, policy=policy, start=start, last_path=way, **more)
    assert 'kept: ' in kept.message
    assert kept.message.endswith('instruction: 1 of 1 clauses kept')
    assert statuses(kept) == ['kept']
    assert kept.path.tolist() == way.cells[3:].tolist()
    # Another instruction is another way, whatever it costs.
    clause = Pass(region=RACK, side='north')
    plain = plan(planner, clause, policy=policy, start=start, **more)
    other = plan(planner, clause, policy=policy, start=start, last_path=way, **more)
    assert f'changed: "{clause.sentence()}" is kept now' in other.message
    assert other.path.tolist() == plain.path.tolist()


def test_a_way_kept_at_any_price_visits_what_is_left_to_visit(planner):
    more = {'switch_margin': 10.0}
    first = plan(planner, Visit(regions=(WEST,)), **more)
    way = way_of(first, planner.costmap)
    kept = plan(planner, Visit(regions=(WEST,)), last_path=way, **more)
    assert 'kept: ' in kept.message
    assert inside(planner, kept, 'west room') > 0.5
    # The straight way visits nothing.
    straight = way_of(plan(planner), planner.costmap)
    other = plan(planner, Visit(regions=(WEST,)), last_path=straight, **more)
    assert 'changed: ' in other.message
    assert statuses(other) == ['kept']
