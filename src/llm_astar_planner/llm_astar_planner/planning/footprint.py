# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""The robot's polygon: its text, what is wrong with it, its radii.

Imported with the parameters, so without what takes long to import.
"""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from llm_astar_msgs_adapter.errors import LlmAstarError, short_repr, shortened
from numpy.typing import ArrayLike

from llm_astar_planner.costmap.config import MAX_RADIUS
from llm_astar_planner.lazy import shapely
from llm_astar_planner.search.arrays import Float64s

MIN_POINTS, MAX_POINTS = 3, 64
MAX_CHARS = 4096
# Of a circle in Nav2's costmaps; padding moves its points by another share in each direction.
CIRCLE_POINTS, ROUND = 16, 0.9
# Square metres; a polygon of less is a line.
MIN_AREA = 1e-6
# As Nav2 writes a footprint: [[x, y], ...], with commas or blanks between the numbers.
TEXT = re.compile(r'\s*\[\s*(?:\[[-+.\deE,\s]*\][,\s]*)*\]\s*')
POINT = re.compile(r'\[([^\[\]]*)\]')


class FootprintError(LlmAstarError, ValueError):
    """A text or a list of points that is no footprint; the message says why."""


@dataclass(frozen=True)
class Footprint:
    """The outline of a robot: points (x, y) in metres in its base frame, in either direction.

    It may be concave, and the frame's origin may lie outside of it. Raises FootprintError for
    fewer than 3 or more than 64 points, for one that is not finite or over 10 m away, and for an
    outline that crosses or touches itself or encloses nothing.
    """

    points: tuple[tuple[float, float], ...]

    def __post_init__(self) -> None:
        """Check the points."""
        problem = outline_problem(self.points)
        if problem is not None:
            raise FootprintError(f'footprint: {problem}')

    @classmethod
    def of(cls, points: ArrayLike) -> Footprint:
        """Return the footprint of points [n, 2] in metres. Raises FootprintError."""
        pairs = np.asarray(points, dtype=np.float64).reshape(-1, 2).tolist()
        return cls(tuple((x, y) for x, y in pairs))

    @classmethod
    def parse(cls, text: str) -> Footprint | None:
        """Return the footprint that a text describes as Nav2's parameter does; None for none.

        '[[0.3, 0.2], [0.3, -0.2], [-0.3, -0.2], [-0.3, 0.2]]' is a rectangle; '' and '[]' say
        that there is no footprint. Raises FootprintError.
        """
        if len(text) > MAX_CHARS:
            raise FootprintError(f'footprint: {len(text)} characters, over {MAX_CHARS}')
        if not text.strip():
            return None
        if not TEXT.fullmatch(text):
            raise FootprintError(
                f'footprint: {short_repr(text)} is not of the form [[x, y], [x, y], ...]'
            )
        points = []
        for pair in POINT.findall(text.strip()[1:-1]):
            try:
                x, y = map(float, pair.replace(',', ' ').split())
            except ValueError:
                raise FootprintError(
                    f'footprint: [{shortened(pair)}] is not a pair of numbers'
                ) from None
            points.append((x, y))
        return cls(tuple(points)) if points else None

    @cached_property
    def array(self) -> Float64s:
        """The points [n, 2] in metres, read-only."""
        points = np.array(self.points)
        points.flags.writeable = False
        return points

    @cached_property
    def circumscribed_radius(self) -> float:
        """Metres from the origin to the farthest point."""
        return max(math.hypot(x, y) for x, y in self.points)

    @cached_property
    def inscribed_radius(self) -> float:
        """Metres from the origin to the nearest edge; 0 if the origin lies outside."""
        body, origin = shapely.Polygon(self.points), shapely.Point(0.0, 0.0)
        return float(body.exterior.distance(origin)) if body.contains(origin) else 0.0

    @property
    def is_round(self) -> bool:
        """Whether it is what Nav2 makes of a robot's radius: 16 points, perhaps padded."""
        distances = [math.hypot(x, y) for x, y in self.points]
        return len(distances) == CIRCLE_POINTS and min(distances) > ROUND * max(distances)

    def __str__(self) -> str:
        """Return what a message says of it."""
        radii = f'{self.inscribed_radius:.2f} m inscribed, {self.circumscribed_radius:.2f} m'
        return f'{len(self.points)} points, radii {radii} circumscribed'

    def is_close_to(self, points: Float64s, metres: float) -> bool:
        """Tell whether each point lies within `metres` of the same one of `points` [n, 2]."""
        if self.array.shape != points.shape:
            return False
        return bool(np.hypot(*(self.array - points).T).max() <= metres)


def outline_problem(points: tuple[tuple[float, float], ...]) -> str | None:
    """Say why points (x, y) in metres are no outline of a robot; None where they are."""
    count = len(points)
    if not MIN_POINTS <= count <= MAX_POINTS:
        return f'{count} points; it needs {MIN_POINTS} to {MAX_POINTS}'
    for number, point in enumerate(points, start=1):
        if not all(map(math.isfinite, point)) or math.hypot(*point) > MAX_RADIUS:
            return f'point {number}, {point}, is not within {MAX_RADIUS:g} m of the origin'
    if any(begin == end for begin, end in zip(points, points[1:] + points[:1])):
        return 'two points in a row are the same'
    outline = shapely.Polygon(points)
    if not outline.is_valid:
        return f'its outline meets itself ({shapely.is_valid_reason(outline)})'
    return 'it encloses no area' if outline.area < MIN_AREA else None
