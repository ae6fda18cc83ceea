"""The ROS nodes: they translate and schedule, and leave the planning to the core."""
