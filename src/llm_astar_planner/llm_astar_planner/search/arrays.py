# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""Arrays by the type of their elements, and the flag by which another thread stops a search."""

from __future__ import annotations

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
# One element, which the compiled loops poll: 0 to go on, anything else to stop.
StopFlag = Uint8s
# Seconds between two looks at a caller's stop flag, so a cancel takes effect within this time.
POLL_PERIOD_S = 0.01


def no_stop() -> StopFlag:
    """Return a stop flag that is not raised; set its one element to 1 to stop a search."""
    return np.zeros(1, dtype=np.uint8)
