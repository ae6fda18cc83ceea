"""Goals and their responses, as the node's services and actions hand them to what plans."""

from __future__ import annotations

import threading
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol

import numpy as np
from geometry_msgs.msg import PoseStamped
from nav_msgs.msg import Path

# The services are there before what plans is imported: see planner_node.
if TYPE_CHECKING:
    from llm_astar_planner.planning.planner import Planner
    from llm_astar_planner.planning.types import Plan, PlanRequest


@dataclass(frozen=True, eq=False)
class PlanGoal:
    """What a caller wants: a path from `start`, or from the robot's pose, through `goals`.

    `tolerance` in metres replaces the parameter if it is above 0. `planner_id` may name a method.
    `fallback_start` is used if the robot's pose is not known. `viapoints` guide the search; the
    path need not pass them.
    """

    goals: tuple[PoseStamped, ...]
    start: PoseStamped | None = None
    tolerance: float = 0.0
    planner_id: str = ''
    fallback_start: PoseStamped | None = None
    viapoints: tuple[PoseStamped, ...] = ()


class CancellationToken:
    """Cancellation of one plan: the search polls `stop`; `reason` says why, '' while it runs."""

    def __init__(self) -> None:
        """Make a token that is not cancelled."""
        self.stop = np.zeros(1, dtype=np.uint8)
        self.reason = ''

    def cancel(self, reason: str) -> None:
        """Cancel, once and for all; the first reason counts."""
        self.reason = self.reason or reason
        self.stop[0] = 1


class PreemptingGoalSlot:
    """A new goal preempts the previous one."""

    def __init__(self) -> None:
        """Make an empty slot."""
        self._lock = threading.Lock()
        self._current = CancellationToken()

    def begin(self, reason: str, token: CancellationToken | None = None) -> CancellationToken:
        """Cancel the previous goal for this reason; return the token of the new one."""
        with self._lock:
            previous, self._current = self._current, token or CancellationToken()
            previous.cancel(reason)
            return self._current

    def cancel(self, reason: str) -> None:
        """Cancel the current goal, if there is one."""
        with self._lock:
            self._current.cancel(reason)


@dataclass(frozen=True, eq=False)
class PlanResponse:
    """What a caller gets: the goal, the plan, its path as a message (empty on failure).

    `planner` is the one that planned and `request` what it was asked, None if it never came to
    planning; its map had arrived `map_age` seconds before. `started` is in monotonic seconds,
    `seconds` wall time.
    """

    goal: PlanGoal
    plan: Plan
    path: Path
    started: float = 0.0
    seconds: float = 0.0
    planner: Planner | None = None
    request: PlanRequest | None = None
    map_age: float | None = None


class GoalAnswerer(Protocol):
    """Answers goals, as the planner node does."""

    @property
    def is_active(self) -> bool:
        """Whether goals are answered."""

    def answer_goal(
        self,
        goal: PlanGoal,
        token: CancellationToken | None = None,
        on_better: Callable[[], None] | None = None,
    ) -> PlanResponse:
        """Plan and publish; never raises."""
