"""From a caller's poses to a request of the core, or the code and the sentence it fails with."""

from __future__ import annotations

from dataclasses import dataclass

from geometry_msgs.msg import PoseStamped
from llm_astar_msgs_adapter.maps.grid_map import GridMap, GridMapError, Pose2D

from llm_astar_planner.nodes.common.parameters import Parameters
from llm_astar_planner.nodes.common.tf import FrameError, Frames, MayWait, never
from llm_astar_planner.planning.types import PlanRequest, ResultCode
from llm_astar_planner.search.paper import METHODS
from llm_astar_planner.waypoints.source import WaypointSource

# How a caller names this planner in `planner_id`; GridBased is what Nav2's behaviour trees say.
OWN_IDS = ('', 'LLMAStar', 'GridBased')


@dataclass(frozen=True, eq=False)
class PlanGoal:
    """What a caller wants: a way from `start`, or from where the robot is, through `goals`.

    `tolerance` in metres counts where it is above 0, else the parameter does. `planner_id` may
    name a method. `fallback_start` serves where the robot's pose is not known.
    """

    goals: tuple[PoseStamped, ...]
    start: PoseStamped | None = None
    tolerance: float = 0.0
    planner_id: str = ''
    fallback_start: PoseStamped | None = None


@dataclass(frozen=True)
class Ends:
    """A question's poses in the map's frame."""

    start: Pose2D
    goals: tuple[Pose2D, ...]


class RequestError(Exception):
    """A question that cannot be planned for: why, and Nav2's code of it."""

    def __init__(self, code: ResultCode, message: str) -> None:
        """Say why."""
        super().__init__(message)
        self.code = code


class RequestConverter:
    """Reads questions under the node's parameters."""

    def __init__(
        self, settings: Parameters, frames: Frames, source: WaypointSource | None
    ) -> None:
        """Take what a request is made of beside the question."""
        self._settings = settings
        self._frames = frames
        self._source = source

    def ends(self, question: PlanGoal, grid_map: GridMap, may_wait: MayWait = never) -> Ends:
        """Return the question's poses on a map; a transform is waited for while `may_wait()`.

        Raises RequestError, and what `may_wait` raises.
        """
        frame_id = grid_map.frame_id
        if not question.goals:
            raise RequestError(ResultCode.UNKNOWN, 'no goal is given')
        try:
            start = self._start(question, frame_id, may_wait)
            goals = tuple(
                self._frames.locate(goal, frame_id, 'goal', may_wait) for goal in question.goals
            )
        except FrameError as error:
            raise RequestError(ResultCode.TF_ERROR, str(error)) from None
        except GridMapError as error:
            raise RequestError(ResultCode.UNKNOWN, str(error)) from None
        return Ends(start, goals)

    def _start(self, question: PlanGoal, frame_id: str, may_wait: MayWait) -> Pose2D:
        """Return the start given, or the robot's pose, or the one to fall back on."""
        if question.start is not None:
            return self._frames.locate(question.start, frame_id, 'start', may_wait)
        base, fallback = self._settings['robot_base_frame'], question.fallback_start
        if fallback is None:
            return self._frames.robot(base, frame_id, may_wait)
        try:
            return self._frames.robot(base, frame_id)
        except FrameError:
            return self._frames.locate(fallback, frame_id, 'start', may_wait)

    def request(
        self, question: PlanGoal, ends: Ends, grid_map: GridMap, *, want_expanded: bool
    ) -> PlanRequest:
        """Return the request for the core. Raises RequestError."""
        settings, own = self._settings, question.tolerance
        *via, goal = (grid_map.world_to_cell(place.x, place.y) for place in ends.goals)
        return PlanRequest(
            start=grid_map.world_to_cell(ends.start.x, ends.start.y),
            goal=goal,
            via=tuple(via),
            method=self._method(question.planner_id),
            source=self._source if settings['use_waypoints'] else None,
            heuristic=settings['heuristic'],
            weight=settings['weight'],
            time_limit=settings['max_planning_time'],
            source_time_limit=settings['source_timeout'],
            max_suboptimality=settings['max_suboptimality'] or None,
            search_while_waiting=settings['search_while_waiting'],
            any_angle=settings['any_angle'],
            want_expanded=want_expanded,
            # What is no number is the core's to refuse.
            tolerance=settings['tolerance'] if own <= 0.0 else own,
            start_tolerance=settings['start_tolerance'],
            instruction=settings['instruction'],
        )

    def _method(self, planner_id: str) -> str:
        if planner_id in OWN_IDS:
            return str(self._settings['method'])
        if planner_id in METHODS:
            return planner_id
        names = ', '.join([*OWN_IDS[1:], *METHODS])
        message = f'no planner {planner_id!r}; there is {names}'
        raise RequestError(ResultCode.INVALID_PLANNER, message)
