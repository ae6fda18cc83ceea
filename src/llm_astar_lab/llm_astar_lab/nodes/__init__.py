"""The ROS nodes and clients of the laboratory."""
