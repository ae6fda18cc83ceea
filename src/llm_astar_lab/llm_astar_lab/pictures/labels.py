"""Places texts on a picture so that none hides another, a mark or, where it can be, the path."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patheffects import withStroke
from matplotlib.text import Text
from numpy.typing import NDArray
from shapely.geometry.base import BaseGeometry

# Sizes of a name in points, tried in this order, and shifts in its own sizes.
SIZES = (9.0, 7.5, 6.0)
SHIFTS = ((0, 0), (0, 1), (0, -1), (0, 2), (0, -2), (0.6, 0), (-0.6, 0), (0, 3), (0, -3))
# The size of a number in points, and where it may be beside its mark, in points: the directions at
# growing distances.
NUMBER_SIZE = 9.5
DIRECTIONS = ((1, 1), (-1, 1), (1, -1), (-1, -1), (0, 1), (1, 0), (0, -1), (-1, 0))
DISTANCES = (0.0, 5.0, 10.0, 16.0)
# Half the size of a mark and the space around a text, in points.
MARK, SPACE = 6.5, 1.5
HALO = [withStroke(linewidth=2.5, foreground='white')]

# Left, bottom, right, top in pixels.
Box = tuple[float, float, float, float]


class Labels:
    """The texts of one picture. Its axes must have their final limits and size."""

    def __init__(self, axes: Axes, path: NDArray[np.float64] | None = None) -> None:
        """Take the axes, and the path [n, 2] that texts avoid, in their coordinates."""
        self.axes = axes
        # The layout moves the axes when the figure is drawn.
        root = axes.get_figure(root=True)
        if root is not None:
            root.draw_without_rendering()
        self.point = 1.0 if root is None else root.dpi / 72
        self.boxes: list[Box] = []
        self.frame = axes.get_window_extent()
        self.path = np.empty((0, 2)) if path is None else self.pixels(path)

    def pixels(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return points [n, 2] in pixels."""
        found: NDArray[np.float64] = self.axes.transData.transform(points)
        return found

    def take(self, points: NDArray[np.float64]) -> None:
        """Keep texts off marks at points [n, 2]."""
        half = MARK * self.point
        for x, y in self.pixels(points).tolist():
            self.boxes.append((x - half, y - half, x + half, y + half))

    def add_number(self, text: str, x: float, y: float) -> None:
        """Write a short text beside a mark."""
        label = self.axes.text(
            x, y, text, ha='center', va='center', fontsize=NUMBER_SIZE, fontweight='bold',
            zorder=6, path_effects=HALO, parse_math=False,
        )  # fmt: skip
        ((at_x, at_y),) = self.pixels(np.array([(x, y)])).tolist()
        self.put(label, self.places_beside(label, at_x, at_y))

    def places_beside(self, label: Text, x: float, y: float) -> Iterator[Box]:
        """Yield boxes for a text around a mark, the closest first."""
        extent = label.get_window_extent()
        half_width, half_height = extent.width / 2, extent.height / 2
        for distance in DISTANCES:
            reach = (MARK + distance) * self.point
            for right, up in DIRECTIONS:
                # At a corner a text may come closer along both axes.
                part = 0.8 if right and up else 1.0
                middle_x = x + right * part * (reach + half_width)
                middle_y = y + up * part * (reach + half_height)
                yield (
                    middle_x - half_width, middle_y - half_height,
                    middle_x + half_width, middle_y + half_height,
                )  # fmt: skip

    def add_name(self, name: str, shape: BaseGeometry) -> None:
        """Write a name in the middle of its place, upright where the place is too narrow.

        It is written smaller, or moved, where it would hide something.
        """
        middle = shape.centroid if shape.contains(shape.centroid) else shape.representative_point()
        label = self.axes.text(
            middle.x, middle.y, name, ha='center', va='center', color='black', zorder=6,
            path_effects=HALO, clip_on=True, parse_math=False,
        )  # fmt: skip
        # The name of a point stands above its mark.
        shifts = (*SHIFTS[1:], SHIFTS[0]) if shape.geom_type == 'Point' else SHIFTS
        for size in SIZES:
            label.set_fontsize(size)
            label.set_rotation(self.rotation(label, shape))
            extent = label.get_window_extent()
            box = (extent.x0, extent.y0, extent.x1, extent.y1)
            if self.put(label, (shifted(box, shift) for shift in shifts)):
                return

    def put(self, label: Text, places: Iterable[Box]) -> bool:
        """Move a text to the first place that hides nothing, else to one that hides the path.

        Where all hide a mark or a text it goes to the first; returns False.
        """
        candidates = list(places)
        free = [box for box in candidates if self.is_free(box)]
        chosen = next((box for box in free if not self.hides_path(box)), None)
        chosen = chosen or (free or candidates)[0]
        corners = np.reshape(chosen, (2, 2))
        label.set_position(self.axes.transData.inverted().transform(corners).mean(axis=0))
        if free:
            self.boxes.append(chosen)
        return bool(free)

    def is_free(self, box: Box) -> bool:
        """Tell whether a text in a box is within the picture and hides no mark and no text."""
        space = SPACE * self.point
        x0, y0, x1, y1 = box[0] - space, box[1] - space, box[2] + space, box[3] + space
        inside = self.frame.x0 <= x0 and x1 <= self.frame.x1
        inside = inside and self.frame.y0 <= y0 and y1 <= self.frame.y1
        return inside and not any(
            x0 < right and left < x1 and y0 < top and bottom < y1
            for left, bottom, right, top in self.boxes
        )

    def hides_path(self, box: Box) -> bool:
        """Tell whether a box covers a point of the path."""
        x, y = self.path.T
        covered = (box[0] <= x) & (x <= box[2]) & (box[1] <= y) & (y <= box[3])
        return bool(covered.any())

    def rotation(self, label: Text, shape: BaseGeometry) -> float:
        """Return 90 degrees for a name that fits into its place only upright, else 0."""
        label.set_rotation(0.0)
        box = label.get_window_extent()
        corners = np.reshape(shape.bounds, (2, 2))
        width, height = np.ptp(self.pixels(corners), axis=0)
        return 90.0 if box.width > width and height > 1.2 * max(width, box.height) else 0.0


def shifted(box: Box, shift: tuple[float, float]) -> Box:
    """Return a box moved by parts of its own size."""
    x0, y0, x1, y1 = box
    dx, dy = shift[0] * (x1 - x0), shift[1] * (y1 - y0)
    return x0 + dx, y0 + dy, x1 + dx, y1 + dy
