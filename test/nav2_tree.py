"""Nav2's default behaviour tree, to test how a planner's answers make it go on or give up.

Written after nav2_behavior_tree and `navigate_to_pose_w_replanning_and_recovery.xml` (branch
jazzy): the same nodes, time limits and handling of results. Following the path, Spin, Wait and
BackUp are other servers' and stand in as nodes that succeed.
"""

import time

from nav2_msgs.action import ComputePathThroughPoses, ComputePathToPose
from nav2_msgs.srv import ClearEntireCostmap, IsPathValid
from nav2_tree_control import (
    FAILURE,
    IDLE,
    RUNNING,
    SUCCESS,
    Fallback,
    PipelineSequence,
    RateController,
    ReactiveFallback,
    ReactiveSequence,
    RecoveryNode,
    RoundRobin,
    Sequence,
    TreeError,
    TreeNode,
)
from nav_msgs.msg import Path
from rclpy.action import ActionClient
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node

LOOP_SECONDS = 0.01
WAIT_FOR_SERVICE_SECONDS = 1.0
CANCEL_SECONDS = 0.05
ACCEPTED, EXECUTING, SUCCEEDED, CANCELED, ABORTED = 1, 2, 4, 5, 6


class WouldRecoveryHelp(TreeNode):
    """Succeeds for the codes after which a recovery is tried."""

    def __init__(self, blackboard, key, codes):
        super().__init__()
        self._blackboard, self._key, self._codes = blackboard, key, codes

    def tick(self):
        return SUCCESS if self._blackboard.get(self._key, 0) in self._codes else FAILURE


class GoalUpdated(TreeNode):
    """Succeeds where the goal has changed since the tick before."""

    def __init__(self, blackboard):
        super().__init__()
        self._blackboard, self._goal = blackboard, None

    def tick(self):
        was_idle, before = self.status is IDLE, self._goal
        self._goal = self._blackboard['goal']
        return FAILURE if was_idle or before == self._goal else SUCCESS


class SameGoal(GoalUpdated):
    """GlobalUpdatedGoal under an Inverter: fails where the goal is new, also the first time."""

    def tick(self):
        before, self._goal = self._goal, self._blackboard['goal']
        return SUCCESS if before == self._goal else FAILURE


class StandIn(TreeNode):
    """Another server's action: runs for `seconds` and succeeds; `count` says how often."""

    def __init__(self, seconds=0.0):
        super().__init__()
        self._seconds, self._begin, self.count = seconds, 0.0, 0

    def tick(self):
        if self.status is IDLE:
            self._begin = time.monotonic()
            self.count += 1
        return SUCCESS if time.monotonic() - self._begin >= self._seconds else RUNNING


class ActionNode(TreeNode):
    """BtActionNode: sends a goal, and waits for its acknowledgement for `server_timeout`."""

    def __init__(self, client, server_timeout):
        super().__init__()
        self._client, self._timeout = client, server_timeout
        self._spin = client.executor_of_tree
        self._handle = self._future = self._result = None
        self._sent = 0.0
        if not client.actions[self.name].wait_for_server(WAIT_FOR_SERVICE_SECONDS):
            raise TreeError(f'Action server {self.name} not available')

    name = ''

    def make_goal(self):
        raise NotImplementedError

    def finish(self, status, result):
        raise NotImplementedError

    def tick(self):
        if self.status is not RUNNING:
            self.status = RUNNING
            self._handle = self._result = None
            self._future = self._client.actions[self.name].send_goal_async(self.make_goal())
            self._sent = time.monotonic()
        if self._handle is None:
            status = self._wait_for_acknowledgement()
            if status is not None:
                return status
        self._spin.spin_once(timeout_sec=0.0)
        if not self._result.done():
            return RUNNING
        answer = self._result.result()
        self._handle = None
        return self.finish(answer.status, answer.result)

    def halt(self):
        if self.status is RUNNING and self._handle is not None:
            self._spin.spin_once(timeout_sec=0.0)
            if self._handle.status in (ACCEPTED, EXECUTING):
                cancel = self._handle.cancel_goal_async()
                self._spin.spin_until_future_complete(cancel, self._timeout)
                self._spin.spin_until_future_complete(self._result, CANCEL_SECONDS)
        super().halt()

    def _wait_for_acknowledgement(self):
        left = self._timeout - (time.monotonic() - self._sent)
        if left > 0.0:
            self._spin.spin_until_future_complete(self._future, min(left, LOOP_SECONDS / 2.0))
        if not self._future.done():
            if time.monotonic() - self._sent < self._timeout:
                return RUNNING
            self._client.timeouts += 1
            return FAILURE
        self._handle = self._future.result()
        self._client.acknowledged.append(time.monotonic() - self._sent)
        if not self._handle.accepted:
            return FAILURE
        self._result = self._handle.get_result_async()
        return None


class ComputePath(ActionNode):
    """ComputePathToPose; its code and path go to the blackboard."""

    name = 'compute_path_to_pose'

    def make_goal(self):
        blackboard = self._client.blackboard
        return ComputePathToPose.Goal(
            goal=blackboard['goal'], planner_id=blackboard['selected_planner'], use_start=False
        )

    def finish(self, status, result):
        # A cancel counts as a success without a path.
        code = result.error_code if status == ABORTED else 0
        path = result.path if status == SUCCEEDED else Path()
        self._client.blackboard.update(path=path, compute_path_error_code=code)
        self._client.answers.append((status, code, getattr(result, 'error_msg', '')))
        return FAILURE if status == ABORTED else SUCCESS

    def halt(self):
        self._client.blackboard['path'] = Path()
        super().halt()


class ComputePathThrough(ComputePath):
    """ComputePathThroughPoses, through the `goals` of the blackboard."""

    name = 'compute_path_through_poses'

    def make_goal(self):
        blackboard = self._client.blackboard
        goal = ComputePathThroughPoses.Goal(planner_id=blackboard['selected_planner'])
        goals = goal.goals
        if hasattr(goals, 'goals'):
            goals.goals = blackboard['goals']
        else:
            goal.goals = blackboard['goals']
        return goal


class ClearCostmap(TreeNode):
    """BtServiceNode: calls the service that clears a costmap."""

    def __init__(self, client, server_timeout):
        super().__init__()
        self._client, self._timeout = client, server_timeout
        self._future, self._sent = None, 0.0
        if not client.clear.wait_for_service(WAIT_FOR_SERVICE_SECONDS):
            raise TreeError('Service server global_costmap/clear_entirely_... not available')

    def tick(self):
        if self._future is None:
            self._future = self._client.clear.call_async(ClearEntireCostmap.Request())
            self._sent = time.monotonic()
            self._client.clears += 1
        left = self._timeout - (time.monotonic() - self._sent)
        if left > 0.0:
            spin = self._client.executor_of_tree.spin_until_future_complete
            spin(self._future, min(left, LOOP_SECONDS / 2.0))
        is_done = self._future.done()
        if not is_done and time.monotonic() - self._sent < self._timeout:
            return RUNNING
        self._future = None
        return SUCCESS if is_done else FAILURE

    def halt(self):
        self._future = None
        super().halt()


class PathIsValid(TreeNode):
    """IsPathValid: asks whether the path of the blackboard is; no answer in time is a no."""

    def __init__(self, client, server_timeout):
        super().__init__()
        self._client, self._timeout = client, server_timeout

    def tick(self):
        future = self._client.validity.call_async(
            IsPathValid.Request(path=self._client.blackboard['path'])
        )
        self._client.executor_of_tree.spin_until_future_complete(future, self._timeout)
        return SUCCESS if future.done() and future.result().is_valid else FAILURE


class TreeClient(Node):
    """The node that a tree runs in: its clients, its blackboard, and what it saw.

    `answers` are the status, code and message of each plan; `acknowledged` the seconds until
    each goal was accepted.
    """

    def __init__(self, goals, namespace=None, planner_id='GridBased'):
        super().__init__('bt_navigator', namespace=namespace)
        self.blackboard = {
            'goal': goals[-1], 'goals': goals, 'selected_planner': planner_id, 'path': Path()
        }  # fmt: skip
        self.answers, self.acknowledged = [], []
        self.clears = self.timeouts = 0
        self.follow = StandIn()
        self.executor_of_tree = SingleThreadedExecutor()
        self.executor_of_tree.add_node(self)
        self.actions = {
            kind.name: ActionClient(self, action, kind.name)
            for kind, action in (
                (ComputePath, ComputePathToPose),
                (ComputePathThrough, ComputePathThroughPoses),
            )
        }
        self.validity = self.create_client(IsPathValid, 'is_path_valid')
        self.clear = self.create_client(
            ClearEntireCostmap, 'global_costmap/clear_entirely_global_costmap'
        )

    @property
    def codes(self):
        return [code for _, code, _ in self.answers]

    def destroy_node(self):
        for client in self.actions.values():
            client.destroy()
        self.executor_of_tree.shutdown()
        super().destroy_node()


def default_tree(client, kind=ComputePath, server_timeout=0.02):
    """Return the tree of NavigateToPose, or of NavigateThroughPoses with ComputePathThrough."""
    codes = {
        getattr(action.Result, name)
        for action in (ComputePathToPose, ComputePathThroughPoses)
        for name in ('UNKNOWN', 'NO_VALID_PATH', 'TIMEOUT')
    }

    def planner_recovery_would_help():
        return WouldRecoveryHelp(client.blackboard, 'compute_path_error_code', codes)

    plan = RecoveryNode(
        1,
        kind(client, server_timeout),
        Sequence(planner_recovery_would_help(), ClearCostmap(client, server_timeout)),
    )
    recover = Sequence(
        Fallback(
            WouldRecoveryHelp(client.blackboard, 'follow_path_error_code', ()),
            planner_recovery_would_help(),
        ),
        ReactiveFallback(
            GoalUpdated(client.blackboard),
            RoundRobin(ClearCostmap(client, server_timeout), StandIn(), StandIn(), StandIn()),
        ),
    )
    hz = 1.0 if kind is ComputePath else 0.333
    return RecoveryNode(6, PipelineSequence(RateController(hz, plan), client.follow), recover)


def tree_without_needless_plans(client, server_timeout):
    """Return `navigate_w_recovery_and_replanning_only_if_path_becomes_invalid.xml`."""
    plan = RecoveryNode(
        1,
        Fallback(
            ReactiveSequence(SameGoal(client.blackboard), PathIsValid(client, server_timeout)),
            ComputePath(client, server_timeout),
        ),
        ClearCostmap(client, server_timeout),
    )
    recover = ReactiveFallback(
        GoalUpdated(client.blackboard),
        RoundRobin(ClearCostmap(client, server_timeout), StandIn(), StandIn(), StandIn()),
    )
    return RecoveryNode(6, PipelineSequence(RateController(1.0, plan), client.follow), recover)


def run(tree, seconds):
    """Tick a tree every 10 ms until it ends; return how."""
    deadline = time.monotonic() + seconds
    while True:
        begin = time.monotonic()
        status = tree.execute_tick()
        if status is not RUNNING:
            return status
        assert begin < deadline, 'the tree is still running'
        time.sleep(max(0.0, LOOP_SECONDS - (time.monotonic() - begin)))
