"""Which regions of an instruction a robot has visited on its way, from where it plans again."""

from __future__ import annotations

import threading
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from llm_astar_planner.instructions.interpretation import Interpretation
from llm_astar_planner.instructions.route import Route
from llm_astar_planner.instructions.verification import visited_regions

# Metres. How far from its last path a robot may be and still be taken to follow it, at least two
# cells; how far apart two goals are that count as one; and by how much less it has not moved.
FOLLOWS_WITHIN = 1.0
SAME_GOAL = 0.25
STILL = 0.01
# Metres. A path that is so much farther from the robot again has passed it.
RECEDES = 0.3
# Points kept of the way driven.
MAX_DRIVEN = 20_000

Visited = frozenset[tuple[int, int]]
Points = NDArray[np.float64]
NOTHING: Visited = frozenset()


@dataclass(frozen=True, eq=False)
class Drive:
    """A drive to one goal under one instruction.

    Points are metres in the map's frame: `goals` [n, 2] with via points, `driven` [n, 2] all the
    way so far, and `path` [n, 2] what was planned last, empty if nothing was found. `visited` is
    what `interpretation` asks for and was visited.
    """

    interpretation: Interpretation
    goals: Points
    driven: Points
    path: Points
    visited: Visited = NOTHING

    def is_to(self, goals: Points, text: str) -> bool:
        """Tell whether it is to these goals [n, 2] under this instruction."""
        same_shape = goals.shape == self.goals.shape
        near = same_shape and bool((np.abs(goals - self.goals) <= SAME_GOAL).all())
        return near and text == self.interpretation.text

    def reached(self, here: Points, tolerance: float) -> int | None:
        """Return the number of points of the path that a robot has passed; None if it is off.

        Of several stretches of the path near the robot the first one counts, since a path to a
        place and back passes the same point twice.
        """
        if not len(self.path):
            moved = float(np.hypot(*(here - self.driven[-1])))
            return 0 if moved <= tolerance else None
        distances = np.hypot(*(self.path - here).T)
        near = np.flatnonzero(distances <= tolerance)
        if not len(near):
            return None
        nearest = int(near[0])
        for index in range(nearest, len(distances)):
            if distances[index] < distances[nearest]:
                nearest = index
            elif distances[index] > distances[nearest] + RECEDES:
                break
        return nearest + 1


class Progress:
    """Keeps what a robot has visited while it drives to one goal under one instruction.

    It is told each position that is planned from and each path that is found. A robot that is at
    the path it was given has driven along it; one that is elsewhere has begun a new drive, on
    which nothing counts as visited: better to visit a region twice than to claim a visit that
    never was. An instruction that is understood better on the way is held against all of the
    way. Thread-safe.
    """

    def __init__(self) -> None:
        """Start without a drive."""
        self._lock = threading.Lock()
        self._drive: Drive | None = None

    @property
    def visited(self) -> Visited:
        """The regions visited on the current drive."""
        drive = self._drive
        return drive.visited if drive else NOTHING

    def reset(self) -> None:
        """Forget the drive."""
        with self._lock:
            self._drive = None

    def at(
        self, position: ArrayLike, goals: ArrayLike, interpretation: Interpretation, route: Route
    ) -> Visited:
        """Return what is visited when a robot plans from `position` to `goals`, in metres."""
        here = np.asarray(position, dtype=np.float64)
        wanted = np.asarray(goals, dtype=np.float64)
        with self._lock:
            drive = self._drive
            tolerance = max(FOLLOWS_WITHIN, 2.0 * route.costmap.grid_map.resolution)
            passed = None
            if drive is not None and drive.is_to(wanted, interpretation.text):
                passed = drive.reached(here, tolerance)
            if drive is None or passed is None:
                drive = Drive(interpretation, wanted, here[None], np.empty((0, 2)))
                passed = 0
            self._drive = driven_on(drive, here, passed, interpretation, route)
            return self._drive.visited

    def follow(self, path: ArrayLike) -> None:
        """Take the path, [n, 2] metres, that was found from the last position."""
        with self._lock:
            if self._drive is not None:
                self._drive = replace(self._drive, path=np.asarray(path, dtype=np.float64))


def driven_on(
    drive: Drive, here: Points, passed: int, interpretation: Interpretation, route: Route
) -> Drive:
    """Return a drive on which the robot has passed so many points of its path and is `here`."""
    stretch = np.concatenate((drive.driven[-1:], drive.path[:passed], here[None]))
    driven = np.concatenate((drive.driven, stretch[1:]))[-MAX_DRIVEN:]
    visited = drive.visited
    if drive.interpretation is not interpretation:
        stretch, visited = driven, NOTHING
    known = replace(route, visited=visited)
    visited = visited_regions(interpretation.specification, stretch, known)
    return Drive(interpretation, drive.goals, driven, drive.path[passed:], visited)
