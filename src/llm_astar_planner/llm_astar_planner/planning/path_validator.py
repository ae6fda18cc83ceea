# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""The last check before a path leaves. It shares no code with the searches or the inflation."""

import math
from collections.abc import Sequence
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from llm_astar_msgs_adapter.maps.grid_map import GridMap, Pose2D
from numpy.typing import NDArray

from llm_astar_planner.costmap.config import CostmapConfig
from llm_astar_planner.costmap.costmap import Costmap
from llm_astar_planner.lazy import shapely
from llm_astar_planner.planning._kernels import path_checks as kernels
from llm_astar_planner.planning.footprint import Footprint
from llm_astar_planner.planning.types import PlanRequest
from llm_astar_planner.search.arrays import Bools, Float64s, Int32s, Int64s
from llm_astar_planner.search.result import Cell

# Less than the costmap's own rounding, so that no cell which is free there is blocked here.
ROUNDING = 5e-7
# More than any occupancy.
NO_LIMIT = 127
# Poses whose surroundings are looked at together.
CHUNK = 64
# Cells are taken to be this much smaller, in cells, than those of the search: for rounding.
SHRINK = 1e-6
# The occupancy of a lethal cell on a costmap, which has the threshold 99; see the table in
# docs/robot.md.
LETHAL_COST = 100
FAULTS = {
    kernels.OUTSIDE: 'it leaves the map at',
    kernels.OBSTACLE: 'it hits an obstacle at',
    kernels.JUMP: 'it jumps after',
    kernels.CORNER: 'it cuts a corner after',
}
AGAINST = 'it goes against a rule of the road at'
# The bits of a move by one row or column back, none or on, in `GridMap.forbidden`: rows first.
BITS = np.array([[64, 8, 128], [4, 0, 1], [32, 2, 16]], dtype=np.uint8)


class PathMetrics(NamedTuple):
    """Figures of a path that a robot's owner asks for, besides its length.

    `clearance`: metres from its cells to the nearest lethal cell, inf without one;
    `unknown_length`: metres through unknown cells; `turns`: changes of direction.
    """

    clearance: float
    unknown_length: float
    turns: int


class CollisionChecker:
    """What the last check holds paths against: a map and the robot's radius.

    It reads the map's cells and measures distances to lethal ones in them, around the path.
    Nothing is prepared for a map.
    """

    def __init__(self, grid_map: GridMap, config: CostmapConfig) -> None:
        """Take a map and the rules of its costmap."""
        self._resolution, self._cuts_corners = grid_map.resolution, config.corner_cutting
        radius = config.robot_radius / grid_map.resolution
        reach = math.floor(radius**2 + ROUNDING) if radius > 0.0 else -1
        tiles = np.zeros([-(-side // kernels.TILE) for side in grid_map.cells.shape], np.uint8)
        self.rules: kernels.Rules = (
            grid_map.cells, tiles, config.occupied_threshold, config.allow_unknown, reach
        )  # fmt: skip
        self.forbidden = grid_map.forbidden

    def first_against(self, path: NDArray[np.integer[Any]]) -> int:
        """Return the index of the cell of a path [n, 2] that a forbidden move leaves, or -1."""
        if not self.forbidden.size:
            return -1
        (x, y), steps = path[:-1].T, np.diff(path, axis=0) + 1
        against = self.forbidden[y, x] & BITS[steps[:, 1], steps[:, 0]] != 0
        return int(against.argmax()) if against.any() else -1

    def is_free(self, cells: Int64s) -> bool:
        """Tell whether the robot may be in each of the cells [n, 2] of the map, on its way to any.

        So there must be no rules of the road in them.
        """
        x, y = cells.T
        has_rules = self.forbidden.size and self.forbidden[y, x].any()
        return not has_rules and bool(kernels.first_blocked(self.rules, cells) < 0)

    def is_free_curve(self, points: Float64s) -> bool:
        """Tell whether a line through points [n, 2], at most a cell apart, stays on free cells."""
        cells = curve_cells(points)
        return self.path_problem(cells, tuple(cells[0]), tuple(cells[-1])) is None

    def path_problem(self, path: NDArray[np.integer[Any]], start: Cell, goal: Cell) -> str | None:
        """Say what is wrong with a path of cells [n, 2], or None.

        It must run from start to goal, on the map, over free cells, by steps to one of the eight
        neighbours, past no blocked corner unless corners may be cut, and against no rule of the
        road.
        """
        if len(path) == 0:
            return 'it is empty'
        ends = int(start[0]), int(start[1]), int(goal[0]), int(goal[1])
        cells = np.ascontiguousarray(path, np.int64)
        fault, n = kernels.path_fault(self.rules, cells, ends, self._cuts_corners)
        if fault == kernels.FINE:
            n = self.first_against(cells) if self.forbidden.size else -1
            return None if n < 0 else f'{AGAINST} {cell_text(path[n])}'
        if fault == kernels.ENDS:
            return f'it runs from {cell_text(path[0])} to {cell_text(path[-1])}'
        return f'{FAULTS[fault]} {cell_text(path[n])}'

    def segments_problem(self, points: Int32s) -> str | None:
        """Say what is wrong with straight segments between cells [n, 2] at any angle, or None.

        Every cell that a segment passes through must be free. Where it passes exactly over a
        corner of cells, both cells at the corner's sides must be free too, unless corners may be
        cut. From cell to cell it must make no move against a rule of the road. (The search has
        its own line of sight; this one is written apart from it on purpose.)
        """
        for begin, end in pairwise(np.ascontiguousarray(points, np.int64)):
            ends: list[Cell] = [(int(x), int(y)) for x, y in (begin, end)]
            problem = self.path_problem(kernels.passed_cells(begin, end), *ends)
            if problem is not None:
                return f'the segment from {cell_text(begin)} {problem.removeprefix("it ")}'
        return None

    def measure(self, path: Int32s) -> PathMetrics:
        """Measure a path of single moves [n, 2], n > 0."""
        cells = np.ascontiguousarray(path, np.int64)
        squared, unknown, turns = kernels.measure(*self.rules[:3], cells)
        clearance = math.inf if squared == kernels.NO_LETHAL else math.sqrt(squared)
        return PathMetrics(clearance * self._resolution, unknown * self._resolution, turns)


def curve_cells(points: Float64s) -> Int32s:
    """Return the cells [m, 2] that a line through points [n, 2] crosses, in turn.

    The points are in grid coordinates, at most a cell apart.
    """
    cells = np.floor(points + 0.5)
    # A line to a cell at a corner crosses a third one, between the borders that it meets.
    aside = np.flatnonzero((cells[1:] != cells[:-1]).all(axis=1))
    begin, move = points[aside], points[aside + 1] - points[aside]
    parts = (np.maximum(cells[aside], cells[aside + 1]) - 0.5 - begin) / move
    third = np.floor(begin + move * parts.mean(axis=1, keepdims=True) + 0.5)
    cells = np.insert(cells, aside + 1, third, axis=0).astype(np.int32)
    moves: Bools = (np.diff(cells, axis=0) != 0).any(axis=1)
    return np.asarray(cells[np.concatenate([[True], moves])])


def via_problem(path: Int32s, via: Sequence[Cell]) -> str | None:
    """Say which via point a path [n, 2] does not pass in their order, or None."""
    if not via:
        return None
    cells = np.ascontiguousarray(path, np.int64), np.ascontiguousarray(via, np.int64)
    missed = kernels.first_missed(*cells)
    return None if missed < 0 else f'it does not pass via {missed + 1} {via[missed]} in its turn'


def shift_problem(name: str, requested: Cell, used: Cell, limit: float) -> str | None:
    """Say that an endpoint was moved by more than `limit` cells, or None."""
    distance = math.dist(requested, used)
    if distance <= limit * (1.0 + 1e-6):
        return None
    return (
        f'its {name} {used} is {distance:.2f} cells off {requested}, over the {limit:.2f} allowed'
    )


def invalid_poses(
    cells: NDArray[np.integer[Any]],
    checker: CollisionChecker,
    *,
    allow_unknown: bool = True,
    cost_limit: int = NO_LIMIT,
) -> Bools:
    """Tell for each pose of a path whether a robot cannot reach it: bool [n].

    `cells` is [n, 2], the cell (x, y) of each pose; poses may be any distance apart. A pose is
    invalid if it is off the map, if the robot collides there or the cell's occupancy is
    `cost_limit` or more, or if the straight segment that leads to it is blocked. Unknown cells
    are blocked unless both `allow_unknown` and the checker's rules allow them. Nor may the segment
    go against a rule of the road. The path may come from any planner.
    """
    if len(cells) == 0:
        return np.zeros(0, dtype=np.bool_)
    *others, may_be_unknown, reach = checker.rules
    rules = *others, may_be_unknown and allow_unknown, reach
    path = np.ascontiguousarray(cells, np.int64)
    invalid: Bools = kernels.invalid_poses(rules, path, cost_limit)
    for n in range(1, len(path) if checker.forbidden.size else 0):
        if not (invalid[n - 1] or invalid[n]):
            invalid[n] = checker.first_against(kernels.passed_cells(*path[n - 1 : n + 1])) >= 0
    return invalid


def nearest_pose(points: Float64s, x: float, y: float) -> int:
    """Return the index of the point [n, 2] of a path that is nearest to (x, y), n > 0."""
    return int(np.argmin(np.hypot(points[:, 0] - x, points[:, 1] - y)))


def cell_text(cell: NDArray[np.integer[Any]]) -> str:
    """Return a cell [2] as a message shows it."""
    return f'({cell[0]}, {cell[1]})'


def footprint_problem(path: NDArray[Any], costmap: Costmap, request: PlanRequest) -> str | None:
    """Say where the footprint of a request meets an obstacle on a path [n, 2], or None.

    The points are in grid coordinates. At each it looks along the path, to the next one and from
    the one before; at the last along the request's `goal_yaw` too. What it touches at the
    `start_pose`, where the robot is, is no obstacle.
    """
    footprint, grid_map, config = request.footprint, costmap.grid_map, costmap.config
    if footprint is None:
        return None
    yaw = None if request.goal_yaw is None else request.goal_yaw - grid_map.origin.yaw
    poses = poses_along(path, yaw)
    corners = placed(footprint, poses, grid_map.resolution)
    height, width = grid_map.cells.shape
    inside = (corners > -0.5 - SHRINK) & (corners < np.array([width, height]) - 0.5 + SHRINK)
    if not inside.all():
        return pose_text(poses[np.flatnonzero(~inside.all(axis=(1, 2)))[0]], 'leaves the map')
    lethal = LETHAL_COST if config.occupied_threshold == 99 else config.occupied_threshold
    start = request.start_pose
    own = [] if start is None else cells_under(footprint, start, grid_map)
    for first in range(0, len(poses), CHUNK):
        part = corners[first : first + CHUNK]
        left, top = np.floor(part.min(axis=(0, 1)) + 0.5).astype(int)
        right, bottom = np.floor(part.max(axis=(0, 1)) + 0.5).astype(int) + 1
        window = grid_map.cells[top:bottom, left:right]
        blocked = window >= lethal
        if not config.allow_unknown:
            blocked |= window < 0
        for x, y in own:
            if left <= x < right and top <= y < bottom:
                blocked[y - top, x - left] = False
        if not blocked.any():
            continue
        squares = row_boxes(blocked, left, top)
        hits = shapely.STRtree(squares).query(shapely.polygons(part), predicate='intersects')
        if hits.size:
            return pose_text(poses[first + hits[0].min()], 'meets an obstacle')
    return None


def poses_along(path: NDArray[Any], goal_yaw: float | None) -> Float64s:
    """Return the poses (x, y, yaw) [m, 3] of a path of cells, yaws relative to the grid."""
    cells = path.astype(np.float64)
    cells = cells[np.concatenate([[True], (np.diff(cells, axis=0) != 0).any(axis=1)])]
    steps = np.diff(cells, axis=0)
    yaws = np.arctan2(steps[:, 1], steps[:, 0])
    ahead = np.column_stack([cells[:-1], yaws])
    arrived = np.column_stack([cells[1:], yaws])
    poses = np.stack([ahead, arrived], axis=1).reshape(-1, 3)
    if goal_yaw is None:
        return poses
    return np.concatenate([poses, [[*cells[-1], goal_yaw]]])


def placed(footprint: Footprint, poses: Float64s, resolution: float) -> Float64s:
    """Return the corners [m, n, 2] of a footprint at poses [m, 3], in grid coordinates."""
    points = np.array(footprint.points) / resolution
    cos, sin = np.cos(poses[:, 2]), np.sin(poses[:, 2])
    turns = np.stack([np.stack([cos, sin], axis=1), np.stack([-sin, cos], axis=1)], axis=1)
    corners: Float64s = points @ turns + poses[:, None, :2]
    return corners


def cells_under(footprint: Footprint, pose: Pose2D, grid_map: GridMap) -> list[tuple[int, int]]:
    """Return the cells (x, y) that a footprint touches at a pose in the map's frame."""
    place = grid_map.world_to_grid([pose[:2]])[0]
    poses = np.array([[*place, pose.yaw - grid_map.origin.yaw]])
    corners = placed(footprint, poses, grid_map.resolution)[0]
    left, top = np.floor(corners.min(axis=0) + 0.5).astype(int)
    right, bottom = np.floor(corners.max(axis=0) + 0.5).astype(int)
    y, x = np.mgrid[top : bottom + 1, left : right + 1]
    polygon = shapely.Polygon(corners)
    shapely.prepare(polygon)
    touched = shapely.intersects(polygon, shapely.box(x - 0.5, y - 0.5, x + 0.5, y + 0.5))
    return [(int(column), int(row)) for column, row in zip(x[touched], y[touched])]


def row_boxes(blocked: Bools, left: int, top: int) -> NDArray[np.object_]:
    """Return boxes around the blocked cells of a window, those side by side in a row as one."""
    padded = np.pad(blocked, ((0, 0), (1, 1))).astype(np.int8)
    change = np.diff(padded, axis=1)
    y, first = np.nonzero(change == 1)
    _, last = np.nonzero(change == -1)
    half = 0.5 - SHRINK
    boxes: NDArray[np.object_] = shapely.box(
        left + first - half, top + y - half, left + last - 1 + half, top + y + half
    )
    return boxes


def pose_text(pose: Float64s, what: str) -> str:
    """Say what happens to the footprint at a pose."""
    degrees = math.degrees(pose[2]) % 360.0
    return (
        f'the footprint {what} at ({pose[0]:.0f}, {pose[1]:.0f}), turned by {degrees:.0f} degrees'
    )
