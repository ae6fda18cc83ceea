"""Missions in a real Nav2, driven in a loopback simulator, by this planner and by Nav2's own.

`python -m nav2_stack --help`, in test/. Nav2's executables are found in a sourced ROS, or in the
prefix that the variable LLM_ASTAR_NAV2 names.
"""
