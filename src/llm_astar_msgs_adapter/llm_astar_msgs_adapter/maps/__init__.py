# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""Maps as plain values: grids, barrier maps, and the files that they are loaded from."""
