# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""Arrays by the type of their elements, the flag that stops a search, and double buffering."""

from __future__ import annotations

import sys
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

Bools = NDArray[np.bool_]
Int8s = NDArray[np.int8]
Int32s = NDArray[np.int32]
Int64s = NDArray[np.int64]
Uint8s = NDArray[np.uint8]
Uint16s = NDArray[np.uint16]
Uint32s = NDArray[np.uint32]
Float32s = NDArray[np.float32]
Float64s = NDArray[np.float64]
Array = TypeVar('Array', bound=NDArray[Any])
# One element, which the compiled loops poll: 0 to go on, anything else to stop.
StopFlag = Uint8s
# Seconds between two looks at a caller's stop flag, so a cancel takes effect within this time.
POLL_PERIOD_S = 0.01


def no_stop() -> StopFlag:
    """Return a stop flag that is not raised; set its one element to 1 to stop a search."""
    return np.zeros(1, dtype=np.uint8)


class DoubleBuffer:
    """Copies arrays of a map for the next one, into those of the map before where these are free.

    A series of maps shares one. Each array has a name in it. One that anything else still holds,
    or holds a view of, is left alone, and a new one is made.
    """

    def __init__(self) -> None:
        """Hold nothing yet."""
        self._held: dict[str, tuple[NDArray[Any], NDArray[Any], Int64s]] = {}

    def copy(self, name: str, array: Array, windows: Int64s, shape: tuple[int, int]) -> Array:
        """Return a copy of an array of cells that the caller will change in windows only.

        `windows` is int64 [n, 4], (top, bottom, left, right) in cells, half open, and `shape` is
        (height, width). The array itself must not change any more.
        """
        copied = self._updated(name, array, shape)
        if copied is None:
            copied = array.copy()
        self._held[name] = array, copied, windows
        return copied

    def _updated(self, name: str, array: Array, shape: tuple[int, int]) -> Array | None:
        """Return the array of the map before, made equal to `array`; None if it is not free."""
        if name not in self._held:
            return None
        before, now, windows = self._held.pop(name)
        # One count is the variable's, one that of the call.
        if now is not array or sys.getrefcount(before) > 2:
            return None
        before.flags.writeable = True
        old, new = before.reshape(shape), array.reshape(shape)
        for top, bottom, left, right in windows.tolist():
            old[top:bottom, left:right] = new[top:bottom, left:right]
        return before  # type: ignore[return-value]
