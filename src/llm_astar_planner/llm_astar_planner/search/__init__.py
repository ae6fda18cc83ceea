"""Grid search on numpy arrays, without units of maps and without ROS."""
