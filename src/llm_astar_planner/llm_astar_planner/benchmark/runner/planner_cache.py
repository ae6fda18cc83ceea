"""Planners of maps, kept while they may be needed again, within a bound on memory."""

from __future__ import annotations

import threading
from collections import OrderedDict

from llm_astar_msgs_adapter.maps.barrier_map import BarrierMap

from llm_astar_planner.benchmark.datasets.grids import GRID_RULES
from llm_astar_planner.benchmark.datasets.samples import ProblemMap
from llm_astar_planner.costmap.config import CostmapConfig
from llm_astar_planner.planning.planner import Planner

# Of all planners but the newest; a cell takes some 40 bytes with its landmarks.
MAX_CELLS = 2_000_000
MAX_PLANNERS = 16


class PlannerCache:
    """The planners used last, by map and rules. Thread-safe."""

    def __init__(self) -> None:
        """Begin with none."""
        self._planners: OrderedDict[tuple[ProblemMap, CostmapConfig], Planner] = OrderedDict()
        self._lock = threading.Lock()

    def get(self, problem: ProblemMap, rules: CostmapConfig | None) -> Planner:
        """Return the planner of a map; without rules the paper's on barriers, MovingAI's else."""
        barriers = problem if isinstance(problem, BarrierMap) else None
        if rules is None:
            rules = GRID_RULES if barriers is None else CostmapConfig(corner_cutting=True)
        key = problem, rules
        with self._lock:
            planner = self._planners.get(key)
            if planner is not None:
                self._planners.move_to_end(key)
                return planner
            self._make_room()
        planner = Planner(problem.to_grid(), rules, barriers).prepare()
        with self._lock:
            self._planners[key] = planner
        return planner

    def _make_room(self) -> None:
        """Let the oldest go until those left are small enough to have another beside them."""
        while self._planners and (
            len(self._planners) >= MAX_PLANNERS
            or sum(planner.grid_map.cells.size for planner in self._planners.values()) > MAX_CELLS
        ):
            self._planners.popitem(last=False)
