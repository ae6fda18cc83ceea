"""The traced search expands exactly what the compiled one does."""

import numpy as np
from benchmark_samples import planned_again, tasks_of
from llm_astar_lab.datasets.named import load_samples
from llm_astar_lab.runner.engine import run_task
from llm_astar_planner.planning.segment import KEPT_BY_PAPER
from reference_trace import trace


def test_the_traced_search_equals_the_compiled_one(dataset):
    for sample in load_samples(dataset)[::4]:
        for row in run_task(tasks_of([sample], methods=['llm_astar'])[0]):
            planner, plan = planned_again(sample, row)
            targets = [(p.x, p.y) for p in plan.checked_waypoints if p.status in KEPT_BY_PAPER]
            goals = [] if row.method == 'astar' else [*targets, sample.sample.goal]
            traced = trace(planner.costmap.blocked, *sample.sample[:2], goals)
            assert len(traced.order) == row.operation
            expanded = np.zeros_like(plan.expanded)
            expanded[tuple(np.array(traced.order).T[::-1])] = True
            assert (expanded == plan.expanded).all()
            assert traced.path[0] == sample.sample.start
