# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""What all nodes share: spinning, parameters, QoS, tf."""
