"""Plan on an array, and say how far the path may be from the shortest."""

import numpy as np

from llm_astar_planner import CostmapConfig, Planner, PlanRequest

# A PIL image and the path of a map_server yaml file are maps, too.
obstacles = np.zeros((60, 80), dtype=bool)
obstacles[15:60, 30] = True
obstacles[0:45, 50] = True

planner = Planner(obstacles, CostmapConfig(robot_radius=1.0)).prepare()
# The last line of a cell in a notebook, a plan is shown as a picture.
plan = planner.plan(PlanRequest(start=(5, 50), goal=(75, 10)))

print(plan.code.name, plan.message)
print(f'{len(plan.path)} cells, at most {plan.suboptimality_bound:.3f} times the shortest')
