# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""The way that a robot has driven under an instruction, from where it plans again."""

import threading
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

# Metres. How far from its last path a robot may be and still be taken to follow it, at least two
# cells; how far apart two goals are that count as one; and by how much less it has not moved.
FOLLOWS_WITHIN = 1.0
SAME_GOAL = 0.25
STILL = 0.01
# Metres. A path that is so much farther from the robot again has passed it.
RECEDES = 0.3
# Points kept of the way driven.
MAX_DRIVEN = 20_000

Points = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Drive:
    """A drive to one goal under one instruction.

    Points are metres in the map's frame: `goals` [n, 2] with via points, `driven` [n, 2] all the
    way so far, and `path` [n, 2] what was planned last, empty if nothing was found.
    """

    text: str
    goals: Points
    driven: Points
    path: Points

    def is_to(self, goals: Points, text: str) -> bool:
        """Tell whether it is to these goals [n, 2] under this instruction."""
        same_shape = goals.shape == self.goals.shape
        near = same_shape and bool((np.abs(goals - self.goals) <= SAME_GOAL).all())
        return near and text == self.text

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
    """Keeps the way that a robot drives to one goal under one instruction.

    It is told each position that is planned from and each path that is found. A robot that is at
    the path it was given has driven along it; one that is elsewhere has begun a new drive, on
    which nothing counts as done: better to visit a region twice than to claim a visit that never
    was. An instruction that is understood better on the way is held against all of the way.
    Thread-safe.
    """

    def __init__(self) -> None:
        """Start without a drive."""
        self._lock = threading.Lock()
        self._drive: Drive | None = None

    @property
    def metres(self) -> float:
        """The length of the way driven."""
        drive = self._drive
        return 0.0 if drive is None else float(np.hypot(*np.diff(drive.driven, axis=0).T).sum())

    def reset(self) -> None:
        """Forget the drive."""
        with self._lock:
            self._drive = None

    def at(self, position: ArrayLike, goals: ArrayLike, text: str, resolution: float) -> Points:
        """Return the way driven, [n, 2] metres, of a robot that plans from `position` to `goals`.

        `text` is the instruction, `resolution` the metres of a cell.
        """
        here = np.asarray(position, dtype=np.float64)
        wanted = np.asarray(goals, dtype=np.float64)
        tolerance = max(FOLLOWS_WITHIN, 2.0 * resolution)
        with self._lock:
            drive = self._drive
            is_same = drive is not None and drive.is_to(wanted, text)
            passed = drive.reached(here, tolerance) if drive is not None and is_same else None
            if drive is None or passed is None:
                self._drive = Drive(text, wanted, here[None], np.empty((0, 2)))
            else:
                first, rest = drive.driven[:1], drive.driven[1:]
                since = np.concatenate((rest, drive.path[:passed]))[-MAX_DRIVEN:]
                driven = np.concatenate((first, since))
                self._drive = Drive(text, wanted, driven, drive.path[passed:])
            return self._drive.driven

    def follow(self, path: ArrayLike) -> None:
        """Take the path, [n, 2] metres, that was found from the last position."""
        with self._lock:
            if self._drive is not None:
                self._drive = replace(self._drive, path=np.asarray(path, dtype=np.float64))
