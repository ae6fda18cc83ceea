# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""Which moves the rules of the road forbid: against a one-way, or on the left of a lane.

A move is forbidden where its direction has a part against the heading of the cell where it begins
or ends. From one half of a lane to the other, whose headings are opposite, the moves nearest to
straight across are made, so that a lane may be crossed at any angle.
"""

from __future__ import annotations

import math
from itertools import pairwise
from typing import NamedTuple

import numpy as np
import shapely
from llm_astar_msgs_adapter.maps.grid_map import GridMap
from numpy.typing import NDArray

from llm_astar_planner.costmap.raster import cover_window, window_of
from llm_astar_planner.costmap.zones import KEEP_RIGHT, Zone, ZonesError

# The moves in the order of their bits, (x, y).
STEPS = ((1, 0), (0, 1), (-1, 0), (0, -1), (1, 1), (-1, 1), (-1, -1), (1, -1))
# Parts against a heading up to this are rounding.
ROUNDING = 1e-9
# Moves up to 22.5 degrees off straight across cross a lane: one of the eight always does.
ACROSS = math.sin(math.pi / 8.0) + ROUNDING
# A line passes within so many cells of the centres of cells that join each other.
LEAST_REACH = 0.75
# Cells around all parts of a zone's lines: a second's work.
MOST_CELLS = 20_000_000

Window = tuple[slice, slice]


class Headings(NamedTuple):
    """The headings of cells in a window of the map, in radians of the grid, NaN for none.

    `is_left` are the cells of the left half of a lane. All are [height, width] of the window.
    """

    window: Window
    angles: NDArray[np.float64]
    is_left: NDArray[np.bool_]


def forbidden_moves(zone: Zone, layout: GridMap) -> tuple[Window, NDArray[np.uint8]]:
    """Return a window of a map, and the moves out of its cells that a zone forbids, as bits."""
    (rows, columns), angles, is_left = headings_of(zone, layout)
    # Moves into the zone begin beside it.
    angles = np.pad(angles, 1, constant_values=math.nan)
    is_left, cos, sin = np.pad(is_left, 1), np.cos(angles), np.sin(angles)
    found = np.zeros(angles.shape, dtype=np.uint8)
    for bit, (x, y) in enumerate(STEPS):
        along = (x * cos + y * sin) / math.hypot(x, y)
        ahead, left_ahead = (np.roll(part, (-y, -x), (0, 1)) for part in (along, is_left))
        crosses = (is_left != left_ahead) & (abs(along) <= ACROSS) & ~np.isnan(ahead)
        against = (along < -ROUNDING) | (ahead < -ROUNDING)
        found |= (against & ~crosses).astype(np.uint8) << bit
    height, width = layout.cells.shape
    top, left = max(rows.start - 1, 0), max(columns.start - 1, 0)
    bottom, right = min(rows.stop + 1, height), min(columns.stop + 1, width)
    inside = found[top - rows.start + 1 :, left - columns.start + 1 :]
    window = slice(top, bottom), slice(left, right)
    return window, inside[: bottom - top, : right - left]


def headings_of(zone: Zone, layout: GridMap) -> Headings:
    """Return the headings of the cells of a zone."""
    if zone.is_line:
        return line_headings(zone, layout)
    window = window_of(zone.geometry, layout)
    touched = cover_window(zone.geometry, layout, window).touched
    heading = math.radians(zone.heading) - layout.origin.yaw
    angles = np.where(touched, heading, math.nan)
    top, bottom, left, right = window
    return Headings((slice(top, bottom), slice(left, right)), angles, np.zeros_like(touched))


def line_headings(zone: Zone, layout: GridMap) -> Headings:
    """Return the headings of the cells with their centres within a zone of lines.

    Each has that of the part of the lines which is nearest to it, in a keep_right lane the
    opposite one left of it. Raises ZonesError for lines that are too long.
    """
    reach = max(zone.width / 2.0 / layout.resolution, LEAST_REACH)
    parts = []
    for line in shapely.get_parts(shapely.remove_repeated_points(zone.geometry)):
        points = layout.world_to_grid(shapely.get_coordinates(line))
        steps = np.diff(points, axis=0)
        ahead = steps / np.hypot(*steps.T)[:, None]
        # Beyond the end of a part, what is left of it is left of the bend.
        bends = ahead + np.concatenate((ahead[1:], ahead[-1:]))
        parts += [(*ends, bend) for ends, bend in zip(pairwise(points), bends)]
    (rows, columns) = whole = window_around(np.array(parts)[:, :2].reshape(-1, 2), reach, layout)
    shape = rows.stop - rows.start, columns.stop - columns.start
    nearest, angles = np.full(shape, reach + ROUNDING), np.full(shape, math.nan)
    is_left = np.zeros(shape, dtype=np.bool_)
    windows = [window_around(np.array(part[:2]), reach, layout) for part in parts]
    count = sum((y.stop - y.start) * (x.stop - x.start) for y, x in windows)
    if count > MOST_CELLS:
        raise ZonesError(f'zone {zone.label}: its lines pass {count / 1e6:.0f} million cells')
    for (begin, end, bend), window in zip(parts, windows):
        y, x = np.mgrid[window]
        inner = tuple(
            slice(part.start - first.start, part.stop - first.start)
            for part, first in zip(window, whole)
        )
        delta_x, delta_y = end - begin
        x, y = x - begin[0], y - begin[1]
        along = (x * delta_x + y * delta_y) / (delta_x**2 + delta_y**2)
        part = along.clip(0.0, 1.0)
        away = np.hypot(x - part * delta_x, y - part * delta_y)
        across = np.where(
            along > 1.0,
            bend[0] * (y - delta_y) - bend[1] * (x - delta_x),
            delta_x * y - delta_y * x,
        )
        left_of = (across > ROUNDING) & (zone.kind == KEEP_RIGHT)
        # At a bend the part before it counts.
        is_nearer = away < nearest[inner] - ROUNDING
        nearest[inner][is_nearer] = away[is_nearer]
        is_left[inner][is_nearer] = left_of[is_nearer]
        heading = math.atan2(delta_y, delta_x)
        angles[inner][is_nearer] = np.where(left_of, heading + math.pi, heading)[is_nearer]
    return Headings(whole, angles, is_left)


def window_around(corners: NDArray[np.float64], reach: float, layout: GridMap) -> Window:
    """Return the rows and columns of a map within `reach` cells of the box around points."""
    least = np.floor(corners.min(axis=0) - reach).astype(int)
    most = np.ceil(corners.max(axis=0) + reach).astype(int) + 1
    (left, right), (top, bottom) = (
        np.clip(ends, 0, size).tolist()
        for ends, size in zip(zip(least, most), (layout.width, layout.height))
    )
    return slice(top, bottom), slice(left, right)
