# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""What a person at a desk runs: benchmarks, evaluation of bags, reports, pictures, the page."""
