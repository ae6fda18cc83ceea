"""The compiled loops of the last check (numba), independent of the searches and the costmap."""
