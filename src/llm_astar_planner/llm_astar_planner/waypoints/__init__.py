# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""Sources of waypoints: the protocol that every source follows is in `source`."""
