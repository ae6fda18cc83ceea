# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""Double buffering of the arrays of successive maps, so that no array is copied whole."""

from __future__ import annotations

import sys
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

Array = TypeVar('Array', bound=NDArray[Any])


class DoubleBuffer:
    """Copies arrays of a map for the next one, into those of the map before where these are free.

    A series of maps shares one. Each array has a name in it. One that anything else still holds,
    or holds a view of, is left alone, and a new one is made.
    """

    def __init__(self) -> None:
        """Hold nothing yet."""
        self._held: dict[str, tuple[NDArray[Any], NDArray[Any], NDArray[np.int64]]] = {}

    def copy(
        self, name: str, array: Array, windows: NDArray[np.int64], shape: tuple[int, int]
    ) -> Array:
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
