"""Runs methods with waypoint sources over samples."""
