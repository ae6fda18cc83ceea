# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""Measures how well instructions are understood, enforced and reported, on suites of them."""
