"""Drive along paths on a map that changes: plan again when the way is blocked."""

import numpy as np

from llm_astar_planner import CostmapConfig, Planner, PlanRequest

cells = np.zeros((60, 80), dtype=np.int8)
cells[10:, 40] = 100
planner = Planner(cells, CostmapConfig(robot_radius=1.0)).prepare()
robot, goal, driven = (5, 50), (75, 50), 0

plan = planner.plan(PlanRequest(robot, goal))
while robot != goal:
    robot = tuple(map(int, plan.path[min(5, len(plan.path) - 1)]))
    driven += 1
    if driven == 3:  # a sensor sees a pallet; only what changed is prepared again
        cells[20:24, 20:36] = 100
        planner = Planner(cells, planner.config, previous=planner).prepare()
    plan = planner.plan(PlanRequest(robot, goal, start_tolerance=3.0))
    if plan.code:
        raise SystemExit(f'stopped: {plan.message}')
print(f'at {robot} after {driven} steps')
