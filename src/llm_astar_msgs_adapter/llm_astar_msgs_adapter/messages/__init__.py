"""ROS messages to plain values and back; the only folder that imports ROS messages."""
