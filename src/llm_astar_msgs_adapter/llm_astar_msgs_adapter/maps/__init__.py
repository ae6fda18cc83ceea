"""Maps as plain values: grids, barrier maps, and the files that they are loaded from."""
