# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""Route instructions: understood as a specification, enforced by the search, verified on the path.

Text becomes a `Specification` (grammar, then a model), the specification becomes a search problem
(enforcement), and the path found is held against the specification by code of its own
(verification).
"""
