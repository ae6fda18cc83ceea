"""Points and paths as the rows of a results folder hold them."""

from __future__ import annotations

from collections.abc import Iterable
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray


def parse_points(text: str) -> tuple[tuple[float, float], ...]:
    """Read the points of a row back. Raises ValueError where they are none."""
    points = (item.split(',') for item in text.split(';') if item)
    return tuple((float(x), float(y)) for x, y in points)


def format_points(points: Iterable[Iterable[float]]) -> str:
    """Write points as the rows hold them; `parse_points` reads them back."""
    return ';'.join(','.join(f'{value:g}' for value in point) for point in points)


def turning_points(path: NDArray[np.int32]) -> NDArray[np.int32]:
    """Return the first, the last and every cell of a path [n, 2] at which it turns."""
    if len(path) < 3:
        return path
    steps = np.diff(path, axis=0)
    turns = np.any(steps[1:] != steps[:-1], axis=1)
    return np.asarray(path[np.concatenate([[True], turns, [True]])])


def cells_along(points: NDArray[np.float64]) -> NDArray[np.int32]:
    """Return the cells [m, 2] that a line through points [n, 2] leads over, by single steps."""
    corners = np.rint(points).astype(np.int32)
    legs = [corners[:1]]
    for begin, end in pairwise(corners):
        steps = int(np.abs(end - begin).max())
        parts = np.arange(1, steps + 1)[:, None] / max(steps, 1)
        legs.append(np.rint(begin + parts * (end - begin)).astype(np.int32))
    return np.concatenate(legs)
