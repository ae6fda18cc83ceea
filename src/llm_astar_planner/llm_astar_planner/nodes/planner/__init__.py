"""planner_node: one request from message to message."""
