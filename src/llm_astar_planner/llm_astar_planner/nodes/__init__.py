# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""The ROS nodes: they translate and schedule, and leave the planning to the core."""

# Where each node's `main` is, below this package.
MODULES = {
    'map_node': 'map_node',
    'llm_client_node': 'llm_client_node',
    'planner_node': 'planner.planner_node',
}
# Nodes that llm_astar_lab adds.
LAB_NODES = ('benchmark_node',)
