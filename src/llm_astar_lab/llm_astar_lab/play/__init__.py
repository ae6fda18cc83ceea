# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""A page in the browser to plan on: maps, plans and a running graph, served on loopback."""
