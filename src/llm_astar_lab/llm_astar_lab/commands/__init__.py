# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""The commands that the laboratory adds to `llm-astar`, each a module of its name."""

# As in `llm_astar_planner.cli.main`: the summary of each command.
COMMANDS = {
    'play': 'plan in the browser: drag start and goal, draw walls, watch the search',
    'bench': 'run methods with and without waypoints over a dataset',
    'evaluate': 'plan what recorded bags asked for, and compare',
    'instruct-bench': 'measure how well route instructions are understood and met',
    'report': 'write the reports of a results folder again',
    'compare': 'compare results folders sample by sample, and find regressions',
    'draw': 'draw or animate the search of a method beside that of A*',
    'dataset': 'make or convert datasets',
    'record': 'record maps, requests, plans and exchanges of the live graph into a bag',
}
