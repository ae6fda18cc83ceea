# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""The independent check: a path, measured in metres against what was asked of it.

Nothing here knows how an instruction is enforced. Regions become shapely geometry, the path a
polyline, and what the best path could do is found by searches of their own. A kind of clause has
a module of the name that it has in `clauses`, with a function `check`.
"""
