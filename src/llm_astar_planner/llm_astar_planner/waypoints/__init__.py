"""Sources of waypoints: the protocol that every source follows is in `source`."""
