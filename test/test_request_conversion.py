"""From callers' poses to requests for the planner, with tf2 played by a table."""

import math
from dataclasses import replace
from functools import partial
from threading import Timer
from types import SimpleNamespace
from unittest.mock import Mock

import numpy as np
import pytest
from builtin_interfaces.msg import Time
from geometry_msgs.msg import TransformStamped
from hypothesis import given, settings
from hypothesis import strategies as st
from llm_astar_msgs_adapter.maps.grid_map import GridMap, GridMapError, Pose2D
from llm_astar_msgs_adapter.messages.writing import path_to_message, pose_to_message, quaternion_of
from llm_astar_planner.costmap.config import CostmapConfig
from llm_astar_planner.nodes.common.tf import PATIENCE, POLL_PERIOD_S, FrameError, Frames
from llm_astar_planner.nodes.planner import goals
from llm_astar_planner.nodes.planner.goals import (
    CancellationToken,
    PathAction,
    PlanGoal,
    PlanResponse,
    PreemptingGoalSlot,
    fill_result,
    plan_goal,
)
from llm_astar_planner.nodes.planner.map_manager import MapArrivals, PlanningMap
from llm_astar_planner.nodes.planner.publishers import PlanPublisher
from llm_astar_planner.nodes.planner.request_handler import (
    RequestConverter,
    RequestError,
    RequestHandler,
)
from llm_astar_planner.planning.parameters import PLANNER
from llm_astar_planner.planning.planner import Planner
from llm_astar_planner.planning.types import Plan, PlanRequest, ResultCode
from llm_astar_planner.search.methods import SEARCH_METHODS
from rclpy.logging import LoggingSeverity, get_logger

LONG = 60.0
NOTHING = np.zeros((0, 0), dtype=np.bool_)
STAMP = Time(sec=7, nanosec=5)
MAP = GridMap(np.zeros((20, 30), dtype=np.int8), 0.5)


class Buffer:
    """Knows some transforms, as x, y and yaw by source, from the `after`-th look on."""

    def __init__(self, after=1, on_look=lambda: None, **transforms):
        self.transforms = transforms
        self.after, self.on_look = after, on_look
        self.asked = []

    def lookup_transform(self, target_frame, source_frame, time):
        self.asked.append(time.nanoseconds)
        self.on_look()
        if source_frame not in self.transforms or len(self.asked) < self.after:
            raise LookupError(f'"{source_frame}" passed to lookupTransform does not exist')
        x, y, yaw = self.transforms[source_frame]
        transform = TransformStamped()
        transform.transform.translation.x = x
        transform.transform.translation.y = y
        transform.transform.rotation = quaternion_of(yaw)
        return transform


def pose(x, y, yaw=0.0, frame='map', stamp=STAMP):
    return pose_to_message(Pose2D(x, y, yaw), frame, stamp)


class Settings(dict):
    """The node's parameters at their defaults, but for some."""

    def __init__(self, **changes):
        super().__init__({parameter.name: parameter.default for parameter in PLANNER} | changes)
        self.current = self


def converter(buffer=None, source=None, **changes):
    footprint = SimpleNamespace(current=None)
    return RequestConverter(Settings(**changes), Frames(buffer), source, footprint)


def convert(converter, goal, grid_map=MAP, want_expanded=False):
    return converter.to_request(goal, grid_map, lambda: 2.0, want_expanded=want_expanded)


def to_request(*arguments, **fields):
    return convert(*arguments, **fields)[0]


def refusal(converter, goal):
    with pytest.raises(RequestError) as caught:
        to_request(converter, goal)
    return caught.value.code.name, str(caught.value)


def test_a_pose_of_another_frame_is_transformed_at_its_stamp():
    buffer = Buffer(odom=(10.0, 2.0, math.pi / 2))
    place = Frames(buffer).locate(pose(1.0, 0.0, 0.0, 'odom'), 'map', 'goal')
    assert place == pytest.approx((10.0, 3.0, math.pi / 2))
    assert buffer.asked == [7 * 10**9 + 5]


def test_stamp_zero_means_the_latest_transform():
    buffer = Buffer(odom=(0.0, 0.0, 0.0))
    Frames(buffer).locate(pose(1.0, 0.0, frame='odom', stamp=Time()), 'map', 'goal')
    assert buffer.asked == [0]


def answered(buffer, max_planning_time=LONG, token=None):
    """Answer a goal that is in another frame."""
    settings = Settings(max_planning_time=max_planning_time)
    node = Mock()
    node.get_clock().now().nanoseconds = 10**9 * STAMP.sec + STAMP.nanosec
    newest = PlanningMap(Planner(MAP), 0.0)
    handler = RequestHandler(
        node=node,
        settings=settings,
        maps=SimpleNamespace(newest=newest, is_preparing=False, arrivals=MapArrivals()),
        converter=RequestConverter(settings, Frames(buffer), None, SimpleNamespace(current=None)),
        compiler=SimpleNamespace(is_ready=True),
        publisher=Mock(count_viewers=lambda: 0),
        instructions=SimpleNamespace(current=SimpleNamespace(instruction=None)),
        monitor=Mock(),
    )
    handler.activate()
    goal = PlanGoal((pose(1.0, 1.0, frame='odom'),), pose(2.0, 2.0))
    plan = handler.answer(goal, token).plan
    return plan.code, plan.message


def test_too_many_goals_are_refused_before_any_is_converted():
    goals = (pose(1.0, 1.0, frame='odom'),) * 10_002
    with pytest.raises(RequestError, match='10002, over the 10001 allowed'):
        to_request(converter(), PlanGoal(goals, pose(2.0, 2.0)), MAP)


@pytest.mark.parametrize('start', [pose(2.0, 2.0), pose(2.0, 2.0, frame='')])
def test_a_pose_without_a_frame_is_refused_by_actions_alone(start):
    goal = PlanGoal((pose(1.0, 1.0, frame=''),), start)
    assert to_request(converter(), goal).goal == (2, 2)
    code, why = refusal(converter(), replace(goal, client='compute_path_to_pose'))
    assert code == 'TF_ERROR'
    assert 'has no frame_id' in why


def test_a_path_that_comes_each_second_is_logged_at_debug_level_unless_it_warns():
    node = Mock()
    node.get_name.return_value = 'planner_node'
    publisher = PlanPublisher(Mock(node=node), PreemptingGoalSlot())
    plan = Plan(ResultCode.NONE, 'a path', '', (0, 0), (0, 0), NOTHING)
    for warnings in ((), ('0.20 m off',)):
        response = PlanResponse(None, replace(plan, warnings=warnings), None)
        publisher.publish_report(response, STAMP, is_cancelled=False, is_routine=True)
    publisher._thread.shutdown()
    node.get_logger().debug.assert_called_once_with('path found: a path')
    node.get_logger().info.assert_called_once_with('path found: a path; 0.20 m off')


def test_paths_of_both_severities_are_logged_by_the_real_logger(capfd):
    """It refuses another severity from a line that has logged with one."""
    logger = get_logger('severities')
    logger.set_level(LoggingSeverity.DEBUG)
    node = Mock(get_logger=lambda: logger)
    node.get_name.return_value = 'planner_node'
    publisher = PlanPublisher(Mock(node=node), PreemptingGoalSlot())
    plan = Plan(ResultCode.NONE, 'a path', '', (0, 0), (0, 0), NOTHING)
    for is_routine in (True, False):
        response = PlanResponse(None, plan, None)
        publisher.publish_report(response, STAMP, is_cancelled=False, is_routine=is_routine)
    publisher._thread.shutdown()
    logged = capfd.readouterr().err
    assert 'path found: a path' in logged
    assert 'Traceback' not in logged


def test_the_log_has_what_a_plan_warns_of_and_no_cancel_as_a_warning():
    """Where maps come at 5 Hz, each replan may preempt the one before."""
    node = Mock()
    node.get_name.return_value = 'planner_node'
    publisher = PlanPublisher(Mock(node=node), PreemptingGoalSlot())
    for is_cancelled in (True, False):
        plan = Plan(ResultCode.TIMEOUT, 'canceled: why', '', (0, 0), (0, 0), NOTHING)
        publisher.publish_report(PlanResponse(None, plan, None), STAMP, is_cancelled=is_cancelled)
    moved = replace(plan, code=ResultCode.NONE, message='a path', warnings=('0.20 m off',))
    publisher.publish_report(PlanResponse(None, moved, None), STAMP, is_cancelled=False)
    publisher._thread.shutdown()
    why = 'canceled: why [TIMEOUT 207]'
    said = 'path found: a path; 0.20 m off'
    node.get_logger().info.assert_called_once_with(said)
    node.get_logger().debug.assert_called_once_with(f'no path: {why}')
    node.get_logger().warning.assert_called_once_with(f'no path: {why}')
    node.get_logger().error.assert_not_called()


def test_a_transform_that_comes_late_is_waited_for():
    buffer = Buffer(after=3, odom=(0.0, 0.0, 0.0))
    assert answered(buffer)[0] is ResultCode.NONE
    assert len(buffer.asked) == 3


def test_the_wait_for_a_transform_ends_with_patience_or_with_the_planning_time():
    for seconds, most in ((LONG, PATIENCE / POLL_PERIOD_S), (2.0 * POLL_PERIOD_S, 2)):
        buffer = Buffer()
        code, message = answered(buffer, seconds)
        assert code is ResultCode.TF_ERROR
        assert 'no transform is known' in message
        assert 1 < len(buffer.asked) <= most + 1


def test_a_cancel_ends_the_wait_for_a_transform():
    token = CancellationToken()
    buffer = Buffer(on_look=lambda: token.cancel('a newer goal came'))
    code, message = answered(buffer, token=token)
    assert (code, message) == (ResultCode.TIMEOUT, 'canceled: a newer goal came')
    assert len(buffer.asked) == 1


def test_poses_of_the_maps_frame_or_of_none_need_no_tf2():
    for frame in ('map', ''):
        assert Frames(None).locate(pose(1.0, 2.0, frame=frame), 'map', 'goal')[:2] == (1.0, 2.0)


@pytest.mark.parametrize(
    ('buffer', 'words'),
    [(None, 'tf2_ros is not installed'), (Buffer(), 'no transform is known: "odom" passed')],
)
def test_what_cannot_be_transformed_is_a_tf_error_with_the_reason(buffer, words):
    for goal in (
        PlanGoal((pose(1.0, 1.0, frame='odom'),), pose(2.0, 2.0)),
        PlanGoal((pose(1.0, 1.0),), pose(2.0, 2.0, frame='odom')),
    ):
        code, message = refusal(converter(buffer), goal)
        assert code == 'TF_ERROR'
        assert words in message
        assert "'odom', the map in 'map'" in message


def test_without_a_start_the_robots_pose_counts():
    buffer = Buffer(base_link=(3.0, 4.0, 0.5), robot_base=(5.0, 6.0, 0.0))
    goal = PlanGoal((pose(1.0, 1.0),))
    assert convert(converter(buffer), goal)[1] == pytest.approx((3.0, 4.0, 0.5))
    named = converter(buffer, robot_base_frame='robot_base')
    assert convert(named, goal)[1] == pytest.approx((5.0, 6.0, 0.0))
    code, message = refusal(converter(Buffer()), goal)
    assert code == 'TF_ERROR'
    assert 'base_link' in message


def test_a_fallback_serves_where_the_robots_pose_is_not_known():
    goal = PlanGoal((pose(1.0, 1.0),), fallback_start=pose(9.0, 8.0))
    assert convert(converter(None), goal)[1][:2] == (9.0, 8.0)
    assert convert(converter(Buffer()), goal)[1][:2] == (9.0, 8.0)
    known = Buffer(base_link=(3.0, 4.0, 0.0))
    assert convert(converter(known), goal)[1][:2] == (3.0, 4.0)


def test_a_pose_that_is_not_finite_is_refused():
    goal = PlanGoal((pose(math.nan, 1.0),), pose(2.0, 2.0))
    why = 'goal: holds a number that is not finite'
    assert refusal(converter(), goal) == ('GOAL_OUTSIDE_MAP', why)
    goal = PlanGoal((pose(2.0, 2.0),), pose(math.nan, 1.0))
    assert refusal(converter(), goal)[0] == 'START_OUTSIDE_MAP'
    with pytest.raises(GridMapError):
        Frames(None).locate(pose(1.0, math.inf), 'map', 'goal')


@pytest.mark.parametrize(('asked', 'counts'), [(0.0, 0.5), (-1.0, 0.5), (0.2, 0.2)])
def test_the_callers_tolerance_counts_where_it_states_one(asked, counts):
    goal = PlanGoal((pose(1.0, 1.0),), pose(2.0, 2.0), asked)
    assert to_request(converter(), goal).tolerance == counts


def test_the_planner_refuses_a_tolerance_that_is_not_finite():
    goal = PlanGoal((pose(1.0, 1.0),), pose(2.0, 2.0), math.nan)
    request = to_request(converter(), goal)
    assert Planner(MAP).plan(request).code.name == 'INVALID_PLANNER'


def test_parameters_reach_the_request():
    changes = {
        'start_tolerance': 0.7,
        'max_suboptimality': 0.0,
        'use_waypoints': False,
    }
    goal = PlanGoal((pose(1.0, 1.0), pose(3.0, 3.0), pose(4.1, 5.0)), pose(2.0, 2.0))
    request = to_request(converter(source=object(), **changes), goal, want_expanded=True)
    assert (request.start, request.via, request.goal) == ((4, 4), ((2, 2), (6, 6)), (8, 10))
    assert (request.start_tolerance, request.max_suboptimality) == (0.7, None)
    assert request.time_limit == 2.0
    assert request.source is None
    assert request.want_expanded


@pytest.mark.parametrize(
    ('planner_id', 'method'),
    [('', 'guided'), ('LLMAStar', 'guided'), ('GridBased', 'guided'), ('astar', 'astar')],
)
def test_planner_ids_name_this_planner_or_a_method(planner_id, method):
    goal = PlanGoal((pose(1.0, 1.0),), pose(2.0, 2.0), planner_id=planner_id)
    assert to_request(converter(), goal).method == method


def test_an_unknown_planner_id_is_an_invalid_planner():
    goal = PlanGoal((pose(1.0, 1.0),), pose(2.0, 2.0), planner_id='SmacHybrid')
    code, message = refusal(converter(), goal)
    assert code == 'INVALID_PLANNER'
    assert "'SmacHybrid'" in message
    assert 'LLMAStar' in message


def test_a_planner_id_names_no_code_unless_the_start_did(monkeypatch):
    here = pose(1.0, 1.0)
    for name in ('os:getcwd', 'llm_astar_planner.search.astar:exact_method'):
        goal = PlanGoal((here,), here, planner_id=name)
        assert refusal(converter(), goal)[0] == 'INVALID_PLANNER'
    monkeypatch.setitem(SEARCH_METHODS.loaded, 'package.module:method', None)
    goal = PlanGoal((here,), here, planner_id='package.module:method')
    assert to_request(converter(), goal).method == 'package.module:method'


class ToPose:
    """A result with ComputePathToPose's numbers, of before it had error_msg."""

    UNKNOWN, TF_ERROR, GOAL_OCCUPIED, TIMEOUT, NO_VALID_PATH, NONE = 200, 202, 206, 207, 208, 0


class NewToPose(ToPose):
    """The same, of today."""

    START_OCCUPIED, error_msg = 205, ''


class ThroughPoses:
    """A result with ComputePathThroughPoses's numbers."""

    UNKNOWN, TF_ERROR, NO_VALID_PATH, NONE, NO_VIAPOINTS_GIVEN = 300, 302, 308, 0, 309

    def __init__(self):
        self.error_msg = 'x'


def response(code, message='because', points=(), goals=1):
    plan = Plan(code, message, 'guided', (0, 0), (1, 1), np.zeros((0, 0), dtype=bool))
    goal = PlanGoal((pose(1.0, 1.0),) * goals)
    return PlanResponse(goal, plan, path_to_message(points, 'map', STAMP), seconds=1.25)


def test_results_carry_each_actions_own_numbers():
    to = fill_result(ToPose(), response(ResultCode.TF_ERROR))
    assert (to.error_code, hasattr(to, 'error_msg')) == (202, False)
    assert (to.planning_time.sec, to.planning_time.nanosec) == (1, 250_000_000)
    through = fill_result(ThroughPoses(), response(ResultCode.TF_ERROR))
    assert (through.error_code, through.error_msg) == (302, 'because')
    fine = fill_result(ThroughPoses(), response(ResultCode.NONE))
    assert (fine.error_code, fine.error_msg) == (0, '')
    nothing = fill_result(ThroughPoses(), response(ResultCode.UNKNOWN, goals=0))
    assert nothing.error_code == 309


@pytest.mark.parametrize(
    ('code', 'tolerance', 'name'),
    [
        ('START_OCCUPIED', 0.0, 'NO_VALID_PATH'),
        ('START_OCCUPIED', 0.5, 'NO_VALID_PATH'),
        ('GOAL_OCCUPIED', 0.5, 'NO_VALID_PATH'),
        ('GOAL_OCCUPIED', 0.0, 'GOAL_OCCUPIED'),
        ('NO_VALID_PATH', 0.5, 'NO_VALID_PATH'),
        ('TIMEOUT', 0.5, 'TIMEOUT'),
    ],
)
def test_what_a_cleared_costmap_may_help_has_a_code_that_trees_recover_from(code, tolerance, name):
    request = PlanRequest((0, 0), (1, 1), tolerance=tolerance)
    failed = replace(response(ResultCode[code]), request=request)
    result = fill_result(NewToPose(), failed)
    assert result.error_code == ResultCode[name]
    assert result.error_msg == ('because' if code == name else f'because [{code}]')


def test_a_preempted_goal_has_no_code_and_a_sentence():
    failed = response(ResultCode.TIMEOUT, 'canceled: a newer goal came')
    result = fill_result(NewToPose(), failed, 'a newer goal came')
    assert (result.error_code, result.error_msg) == (0, 'canceled: a newer goal came')
    occupied = response(ResultCode.GOAL_OCCUPIED)
    assert fill_result(NewToPose(), occupied, 'a newer goal came').error_code == 206


def test_goals_of_both_actions_and_of_later_distributions_are_read():
    poses = [pose(1.0, 1.0), pose(2.0, 2.0)]
    common = {'start': pose(3.0, 3.0), 'use_start': True, 'planner_id': 'astar'}
    one = plan_goal(SimpleNamespace(goal=poses[0], **common))
    assert (one.goals, one.start, one.planner_id) == ((poses[0],), common['start'], 'astar')
    jazzy = plan_goal(SimpleNamespace(goals=poses, **common))
    kilted = plan_goal(SimpleNamespace(goals=SimpleNamespace(goals=poses), **common))
    assert jazzy.goals == kilted.goals == tuple(poses)
    assert plan_goal(SimpleNamespace(goals=[], **common)).goals == ()
    assert plan_goal(SimpleNamespace(goal=poses[0], **common | {'use_start': False})).start is None


def test_viapoints_of_later_distributions_are_read():
    common = {'goal': pose(1.0, 1.0), 'start': pose(3.0, 3.0), 'use_start': True, 'planner_id': ''}
    assert plan_goal(SimpleNamespace(**common)).viapoints == ()
    newer = SimpleNamespace(**common, viapoints=[pose(4.0, 1.0), pose(2.0, 1.0, frame='odom')])
    goal = plan_goal(newer)
    assert goal.viapoints == tuple(newer.viapoints)
    frames = Buffer(odom=(1.0, 0.0, 0.0))
    request = to_request(converter(frames, source=object()), goal)
    assert (request.goal, request.viapoints, request.via) == ((2, 2), ((8, 2), (6, 2)), ())


@pytest.mark.parametrize(
    ('viapoints', 'code', 'words'),
    [
        ((pose(1.0, 1.0), pose(math.nan, 1.0)), 'GOAL_OUTSIDE_MAP', 'via point 2'),
        ((pose(1.0, 1.0, frame='odom'),), 'TF_ERROR', 'via point 1'),
        ((pose(1.0, 1.0),) * 1025, 'INVALID_PLANNER', 'viapoints: 1025, over the 1024'),
    ],
)
def test_viapoints_that_cannot_be_used_are_refused(viapoints, code, words):
    goal = PlanGoal((pose(1.0, 1.0),), pose(2.0, 2.0), viapoints=viapoints)
    found, message = refusal(converter(), goal)
    assert found == code
    assert words in message


class NewerThroughPoses(ThroughPoses):
    """A result of after Kilted."""

    ALL_GOALS = -1

    def __init__(self):
        super().__init__()
        self.last_reached_index = 7


def test_newer_results_say_that_all_goals_were_reached():
    for code in (ResultCode.NONE, ResultCode.UNKNOWN):
        result = fill_result(NewerThroughPoses(), response(code))
        assert result.last_reached_index == -1
    assert not hasattr(fill_result(ThroughPoses(), response(code)), 'last_reached_index')


def test_frames_that_are_missing_say_so():
    with pytest.raises(FrameError, match='base_link'):
        Frames(None).robot('base_link', 'map')


any_number = st.floats() | st.floats(-5.0, 20.0)
any_pose = st.builds(
    pose, any_number, any_number, st.floats(-4.0, 4.0), st.sampled_from(['map', '', 'odom', 'x'])
)


@given(
    any_pose | st.none(),
    st.lists(any_pose, max_size=3),
    any_number,
    st.sampled_from(['', 'LLMAStar', 'astar', 'guided', 'no such planner']),
    st.fixed_dictionaries(
        {'start_tolerance': st.floats(0.0, 5.0), 'max_suboptimality': st.sampled_from([0.0, 1.1])}
    ),
    st.sampled_from([0.0, 0.4]),
)
@settings(max_examples=80)
def test_any_request_gets_a_code_and_a_sentence(
    start, goals, tolerance, planner_id, parameters, robot_radius
):
    cells = np.random.default_rng(3).choice([0, 0, 0, 40, 100, -1], (20, 30)).astype(np.int8)
    grid_map = GridMap(cells, 0.5, Pose2D(-2.0, 1.0, 0.4))
    own = converter(Buffer(odom=(1.0, 2.0, 0.5), base_link=(3.0, 3.0, 0.0)), **parameters)
    goal = PlanGoal(tuple(goals), start, tolerance, planner_id)
    try:
        request = to_request(own, goal, grid_map)
    except RequestError as error:
        assert error.code is not ResultCode.NONE
        assert str(error)
        return
    planner = Planner(grid_map, CostmapConfig(robot_radius=robot_radius))
    plan = planner.plan(request)
    assert plan.message
    assert (plan.code is ResultCode.NONE) == (len(plan.path) > 0)


def test_a_number_just_out_of_its_range_is_refused():
    ranged = [one for one in PLANNER if isinstance(one.default, float)]
    assert 'robot_radius' in {one.name for one in ranged}
    for one in ranged:
        most = one.between[1]
        assert one.problem(most) is None
        assert one.name in one.problem(most * (1.0 + 5e-7))
        assert one.name in one.problem(math.nan)


class Goal:
    """A goal of an action, which rclpy notes the cancel of only after it has told of it."""

    def __init__(self):
        self.goal_id = SimpleNamespace(uuid=bytes(16))
        self.request = SimpleNamespace(
            goal=pose(1.0, 1.0), start=pose(2.0, 1.0), use_start=True, planner_id=''
        )
        self.is_cancel_requested = False
        self.action = self.result = None
        self.ended = ''
        self.canceled, self.abort = (partial(setattr, self, 'ended', end) for end in 'ca')

    def execute(self):
        self.result = self.action.execute(self)


class LateAnswerer:
    """Has a path just when it is canceled; rclpy notes that a moment later."""

    def __init__(self, goal):
        self.goal = goal

    def answer(self, _, token):
        assert token.stop[0]
        Timer(0.05, setattr, (self.goal, 'is_cancel_requested', True)).start()
        return response(ResultCode.NONE, points=[(1.0, 1.0)])


def test_a_goal_canceled_before_it_is_taken_up_ends_as_canceled_and_has_no_path(monkeypatch):
    monkeypatch.setattr(goals, 'ActionServer', Mock())
    goal = Goal()
    kind = SimpleNamespace(Result=ToPose)
    goal.action = PathAction(Mock(), kind, 'plan', LateAnswerer(goal))
    goal.action.on_cancel(goal)
    goal.action.on_accepted(goal)
    assert goal.ended == 'c'
    assert (goal.result.error_code, len(goal.result.path.poses)) == (0, 0)
    assert goal.action._tokens == {}


def test_goals_of_an_action_beyond_a_limit_are_rejected_until_some_have_ended(monkeypatch):
    monkeypatch.setattr(goals, 'ActionServer', Mock())
    action = PathAction(Mock(), SimpleNamespace(), 'plan', Mock(is_active=True))
    under_way = [SimpleNamespace(goal_id=SimpleNamespace(uuid=[n])) for n in range(goals.CALLERS)]
    for handle in under_way:
        assert action.on_goal(None) is goals.GoalResponse.ACCEPT
        action.token_of(handle)
    assert action.on_goal(None) is goals.GoalResponse.REJECT
    del action._tokens[bytes([0])]
    assert action.on_goal(None) is goals.GoalResponse.ACCEPT
