# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""A map under rules: what is blocked, what cells cost, what is connected."""
