"""Waypoints from the embedded transformer."""
