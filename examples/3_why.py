"""Ask why there is no path, and why a path ends beside its goal."""

import numpy as np

from llm_astar_planner import CostmapConfig, Planner, PlanRequest

obstacles = np.zeros((40, 40), dtype=bool)
obstacles[:, 20] = True
obstacles[18:21, 20] = False  # a door of three cells

for radius in (0.5, 2.0):
    planner = Planner(obstacles, CostmapConfig(robot_radius=radius)).prepare()
    plan = planner.plan(PlanRequest((5, 20), (35, 20)))
    # The code is Nav2's; the sentence names what is in the way.
    print(f'radius {radius}: {plan.code.name}: {plan.message}')

# A goal in an obstacle moves to the nearest cell that can be reached, and a warning says so.
planner = Planner(obstacles).prepare()
plan = planner.plan(PlanRequest((5, 20), (20, 25), tolerance=2.0))
print(plan.code.name, *plan.warnings)
