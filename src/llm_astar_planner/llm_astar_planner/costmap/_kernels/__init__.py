"""The compiled loops over the cells of a map (numba)."""
