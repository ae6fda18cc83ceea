"""The last check of a path with the robot's polygon, by shapely: no code of the search's."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import shapely
from llm_astar_msgs_adapter.maps.grid_map import GridMap, Pose2D
from numpy.typing import NDArray

from llm_astar_planner.costmap.costmap import Costmap
from llm_astar_planner.planning.footprint import Footprint
from llm_astar_planner.planning.types import PlanRequest

# Poses whose surroundings are looked at together.
CHUNK = 64
# Cells are taken to be this much smaller, in cells, than those of the search: for rounding.
SHRINK = 1e-6
# The occupancy of a lethal cell on a costmap, which has the threshold 99; see the table in
# docs/robot.md.
LETHAL_COST = 100


def footprint_problem(path: NDArray[Any], costmap: Costmap, request: PlanRequest) -> str | None:
    """Say where the footprint of a request meets an obstacle on a path [n, 2], or None.

    The points are in grid coordinates. At each it looks along the path, to the next one and from
    the one before; at the last along the request's `goal_yaw` too. What it touches at the
    `start_pose`, where the robot is, is no obstacle. Raises ValueError without a footprint.
    """
    footprint, grid_map, config = request.footprint, costmap.grid_map, costmap.config
    if footprint is None:
        raise ValueError('footprint: the request has none')
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


def poses_along(path: NDArray[Any], goal_yaw: float | None) -> NDArray[np.float64]:
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


def placed(
    footprint: Footprint, poses: NDArray[np.float64], resolution: float
) -> NDArray[np.float64]:
    """Return the corners [m, n, 2] of a footprint at poses [m, 3], in grid coordinates."""
    points = np.array(footprint.points) / resolution
    cos, sin = np.cos(poses[:, 2]), np.sin(poses[:, 2])
    turns = np.stack([np.stack([cos, sin], axis=1), np.stack([-sin, cos], axis=1)], axis=1)
    corners: NDArray[np.float64] = points @ turns + poses[:, None, :2]
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


def row_boxes(blocked: NDArray[np.bool_], left: int, top: int) -> NDArray[np.object_]:
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


def pose_text(pose: NDArray[np.float64], what: str) -> str:
    """Say what happens to the footprint at a pose."""
    degrees = math.degrees(pose[2]) % 360.0
    return (
        f'the footprint {what} at ({pose[0]:.0f}, {pose[1]:.0f}), turned by {degrees:.0f} degrees'
    )
