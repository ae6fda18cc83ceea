"""Compiles the kernels ahead of the first plan."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import shapely
from llm_astar_msgs_adapter.maps.grid_map import FREE, OCCUPIED, GridMap, Pose2D

from llm_astar_planner.costmap.config import CostmapConfig
from llm_astar_planner.costmap.costmap import Costmap
from llm_astar_planner.costmap.filter_masks import FilterInfo, FilterKind, FilterMask
from llm_astar_planner.costmap.zone_layer import ZoneLayer
from llm_astar_planner.costmap.zones import Zone
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
from llm_astar_planner.planning._kernels.nearest import nearest_places
from llm_astar_planner.planning.footprint import Footprint
from llm_astar_planner.planning.footprint_checker import FootprintChecker
from llm_astar_planner.planning.path_validator import CollisionChecker, invalid_poses
from llm_astar_planner.planning.planner import Planner
from llm_astar_planner.planning.types import PlanRequest
from llm_astar_planner.search.methods import EXACT, METHODS
from llm_astar_planner.search.paper import compile_kernels as compile_search_kernels
from llm_astar_planner.waypoints.source import WaypointSource

# Seconds, more than compiling takes.
PATIENCE = 3600.0
# Without and with what lethal cells do to others, which takes other kernels.
CONFIGS = (CostmapConfig(), CostmapConfig(robot_radius=1.0, inflation_radius=2.0))


def compile_for(
    config: CostmapConfig,
    like: PlanRequest,
    source: WaypointSource | None = None,
    *,
    is_graded: bool = True,
) -> None:
    """Compile what a request like this takes on a costmap of `config`.

    That of a plug-in's method is compiled without it, since it may take any time. Without
    `source` that is a first plan, for which no landmarks are measured yet; else one with
    landmarks and such waypoints. Where costs are not graded, goals far away take kernels of their
    own.
    """
    cells = np.zeros((24, 24 if is_graded else 100), dtype=np.int8)
    cells[4:, 12] = OCCUPIED
    if is_graded:
        cells[4, 4] = 50
    planner = Planner(GridMap(cells), config)
    start, goal = (2, 20), (cells.shape[1] - 3, 20)
    request = replace(
        like, method=like.method if like.method in METHODS else EXACT,
        start=start, goal=goal, time_limit=PATIENCE, source=source, sample=None,
        instruction=None, via=(), viapoints=(),
    )  # fmt: skip
    if source is not None:
        planner.prepare()
    planner.plan(request)
    if request.footprint is not None:
        compile_footprint_kernels()


def compile_kernels() -> None:
    """Compile what plans without an instruction run, or load it from numba's cache.

    Takes about a minute the first time and half a second after that.
    """
    compile_search_kernels()
    compile_map_kernels()
    compile_zone_kernels()
    cells = np.zeros((24, 24), dtype=np.int8)
    cells[4:, 12] = 50
    for config in CONFIGS:
        planner: Planner | None = None
        for occupancy in (FREE, OCCUPIED):
            cells[10:, 12] = occupancy
            planner = Planner(GridMap(cells), config, previous=planner).prepare()
            for method in METHODS:
                request = PlanRequest(
                    (2, 20), (21, 20), method, time_limit=PATIENCE, any_angle=True, via=((12, 1),)
                )
                planner.plan(request)
                plan = planner.plan(replace(request, via=()))
                nearest_places(plan.path, np.zeros((1, 2)))
    compile_footprint_kernels()


def compile_map_kernels(configs: Sequence[CostmapConfig] = CONFIGS) -> None:
    """Compile what costmaps take, from nothing and in increments, or load it from the cache."""
    for config in configs:
        compile_costmap(config)


def compile_costmap(config: CostmapConfig) -> None:
    """Compile what a costmap takes, from nothing and in increments."""
    cells = np.zeros((24, 24), dtype=np.int8)
    costmap: Costmap | None = None
    for occupancy in (FREE, OCCUPIED):
        cells[10:, 12] = occupancy
        costmap = Costmap(GridMap(cells), config, previous=costmap)
        costmap.prepare()
        costmap.line_of_sight.clear([(0, 0)], [(1, 1)])
    invalid_poses(np.zeros((2, 2), np.int64), CollisionChecker(GridMap(cells), config))


def compile_footprint_kernels() -> None:
    """Compile what plans with a footprint run besides, or load it from numba's cache."""
    cells = np.zeros((24, 24), dtype=np.int8)
    cells[4:, 12] = OCCUPIED
    footprint = Footprint(((1.5, 0.3), (1.5, -0.3), (-1.5, -0.3), (-1.5, 0.3)))
    planner = Planner(GridMap(cells)).prepare()
    for start_pose in (None, Pose2D(3.0, 20.0, 1.0), Pose2D(11.0, 20.0)):
        request = PlanRequest(
            (2, 20), (21, 20), time_limit=PATIENCE, footprint=footprint, start_pose=start_pose
        )
        planner.plan(request)
    FootprintChecker(planner.costmap, footprint).collisions([(3.0, 3.0, 0.0)])


def compile_zone_kernels() -> None:
    """Compile what zones and filter masks take, or load it from the cache."""
    grid_map = GridMap(np.zeros((4, 4), dtype=np.int8))
    mask = FilterMask(FilterInfo(FilterKind.KEEPOUT, 'mask'), grid_map)
    ZoneLayer(grid_map, [Zone('zone', shapely.box(1.0, 1.0, 2.0, 2.0))], [mask]).compose(grid_map)


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
