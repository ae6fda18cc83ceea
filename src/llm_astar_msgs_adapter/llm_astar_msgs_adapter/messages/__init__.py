# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""ROS messages to plain values and back; the only folder that imports ROS messages."""
