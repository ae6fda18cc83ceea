"""Running methods with waypoint sources over samples."""
