"""Grid search, numpy in and numpy out; knows neither maps' units nor ROS."""
