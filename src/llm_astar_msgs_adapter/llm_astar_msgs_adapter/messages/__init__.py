"""ROS messages to plain values and back."""
