"""Ask why there is no path, which other ways there are, and lead as near as possible."""

import numpy as np

from llm_astar_planner import CostmapConfig, Planner, PlanRequest

obstacles = np.zeros((40, 40), dtype=bool)
obstacles[:, 20] = True
obstacles[18:21, 20] = False  # a door of three cells

for radius in (0.5, 2.0):
    planner = Planner(obstacles, CostmapConfig(robot_radius=radius)).prepare()
    plan = planner.plan(PlanRequest((5, 20), (35, 20)))
    # The code is Nav2's; the sentence names what is in the way, and how wide a robot passes.
    print(f'radius {radius}: {plan.code.name}: {plan.message}')
print(plan.why.causes)

# The path to the nearest point that can be reached is marked as partial.
plan = planner.plan(PlanRequest((5, 20), (35, 20), allow_partial_planning=True))
print(plan.message, 'to', plan.path[-1])

# Ways that pass the pillar on either side, each the cheapest of its kind.
obstacles[10:30, 10] = True
for way in Planner(obstacles).plan(PlanRequest((5, 20), (35, 20), alternatives=2)).alternatives:
    print(f'{way.length:.1f} cells, other side of {way.around}')
