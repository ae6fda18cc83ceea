"""Compiles what only plans with an instruction run, ahead of the first of them."""

from __future__ import annotations

import numpy as np
from llm_astar_msgs_adapter.maps.grid_map import OCCUPIED, GridMap

from llm_astar_planner.instructions.interpretation import Interpretation, RouteInstruction
from llm_astar_planner.instructions.specification import (
    SHOULD,
    Avoid,
    Before,
    Box,
    Disc,
    KeepDistance,
    Pass,
    Specification,
    StayIn,
    Visit,
)
from llm_astar_planner.planning.planner import Planner
from llm_astar_planner.planning.types import PlanRequest

# Seconds, more than compiling takes.
PATIENCE = 3600.0


def compile_instruction_kernels() -> None:
    """Compile the kernels for instructions, or load them from numba's cache.

    Takes about half a minute the first time and a tenth of a second after that.
    """
    cells = np.zeros((24, 24), dtype=np.int8)
    cells[4:, 12] = OCCUPIED
    planner = Planner(GridMap(cells)).prepare()
    near, far = Disc(3.0, 3.0, 1.0), Disc(20.0, 3.0, 1.0)
    for clauses in (
        (Visit(regions=(near, far)), Avoid(region=Box(0.0, 0.0, 24.0, 3.0))),
        (
            StayIn(strength=SHOULD, region=Box(0.0, 8.0, 24.0, 24.0)),
            Before(first=near, second=far),
        ),
        (KeepDistance(metres=3.0), Avoid(region=Box(6.0, 0.0, 8.0, 24.0))),
        (Pass(region=Disc(12.5, 14.0, 1.0), side='north'),),
    ):
        instruction = RouteInstruction(Interpretation('', Specification(clauses)))
        request = PlanRequest((2, 20), (21, 20), time_limit=PATIENCE, instruction=instruction)
        planner.plan(request)
