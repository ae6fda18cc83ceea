"""What the ROS messages of an LLM-A* planner mean in plain values, both ways.

`barrier_map`, `grid_map`, `map_update`, `transform` and their like hold values and know nothing
of ROS; so do those that begin with `bag`, which write and read rosbag2's files without it.
`occupancy_grid`, `path`, `waypoints` and `report` translate, one module a message family.
"""
