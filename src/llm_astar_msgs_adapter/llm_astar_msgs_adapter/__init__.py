# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""Maps, ROS messages and rosbag2 files as plain values, both ways; never imports the planner.

`maps` holds grids and barrier maps and the files they load from. `messages` translates live ROS
messages and is the only folder that imports them. `bags` reads and writes rosbag2 files without
ROS.
"""
