# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""Stop flags: how another thread stops a running search."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

# A uint8 array of one element, which the compiled loops poll: 0 to go on, anything else to stop.
StopFlag = NDArray[np.uint8]
# Seconds between two looks at a caller's stop flag, so a cancel takes effect within this time.
POLL_PERIOD_S = 0.01


def no_stop() -> StopFlag:
    """Return a stop flag that is not raised; set its one element to 1 to stop a search."""
    return np.zeros(1, dtype=np.uint8)
