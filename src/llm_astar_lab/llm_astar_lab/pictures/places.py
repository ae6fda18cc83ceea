# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""Draws named places, and texts so that none hides another, a mark or, if it can be, the path."""

from collections.abc import Callable, Iterable, Iterator

import numpy as np
import shapely
from llm_astar_msgs_adapter.maps.grid_map import GridMap
from llm_astar_msgs_adapter.maps.places import Place, Places
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import PathPatch
from matplotlib.path import Path
from matplotlib.patheffects import withStroke
from matplotlib.text import Text
from matplotlib.transforms import Bbox, BboxBase
from numpy.typing import NDArray
from shapely.geometry.base import BaseGeometry

from llm_astar_lab.pictures import raster, style

# Metres around places that are drawn without a map.
MARGIN = 1.0
# Inches of their figure, at most.
WIDTH, MAX_HEIGHT = 8.0, 8.0
TINT = 0.09
# Sizes of a name in points, tried in this order, and shifts in its own sizes.
SIZES = (9.0, 7.5, 6.0)
SHIFTS = ((0, 0), (0, 1), (0, -1), (0, 2), (0, -2), (0.6, 0), (-0.6, 0), (0, 3), (0, -3))
# How far from the middle of a wide place, as a share of its width.
ASIDE = 0.3
# The size of a number in points, and where it may be beside its mark, in points: the directions at
# growing distances.
NUMBER_SIZE = 9.5
DIRECTIONS = ((1, 1), (-1, 1), (1, -1), (-1, -1), (0, 1), (1, 0), (0, -1), (-1, 0))
DISTANCES = (0.0, 5.0, 10.0, 16.0)
# Half the size of a mark and the space around a text, in points.
MARK, SPACE = 6.5, 1.5
HALO = [withStroke(linewidth=2.5, foreground='white')]
# From metres in the map's frame, points [n, 2], to the coordinates of the axes.
Projection = Callable[[NDArray[np.float64]], NDArray[np.float64]]


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
        self.boxes: list[BboxBase] = []
        self.frame = axes.get_window_extent()
        self.path = np.empty((0, 2)) if path is None else self.pixels(path)

    def pixels(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return points [n, 2] in pixels."""
        found: NDArray[np.float64] = self.axes.transData.transform(points)
        return found

    def take(self, points: NDArray[np.float64]) -> None:
        """Keep texts off marks at points [n, 2]."""
        self.boxes += [Bbox([at, at]).padded(MARK * self.point) for at in self.pixels(points)]

    def add_number(self, text: str, x: float, y: float) -> None:
        """Write a short text beside a mark."""
        label = self.axes.text(
            x, y, text, ha='center', va='center', fontsize=NUMBER_SIZE, fontweight='bold',
            zorder=6, path_effects=HALO, parse_math=False,
        )  # fmt: skip
        self.put(label, self.places_beside(label, self.pixels(np.array([x, y]))))

    def places_beside(self, label: Text, mark: NDArray[np.float64]) -> Iterator[BboxBase]:
        """Yield boxes for a text around a mark at (x, y) pixels, the closest first."""
        half = np.array(label.get_window_extent().size) / 2
        for distance in DISTANCES:
            reach = (MARK + distance) * self.point
            for direction in DIRECTIONS:
                # At a corner a text may come closer along both axes.
                part = 0.8 if all(direction) else 1.0
                middle = mark + np.array(direction) * part * (reach + half)
                yield Bbox([middle - half, middle + half])

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
            box = label.get_window_extent()
            # In a wide place there is room to both sides of its middle.
            aside = ASIDE * np.ptp(self.pixels(np.reshape(shape.bounds, (2, 2)))[:, 0]) / box.width
            wide = ((0, 0), (aside, 0), (-aside, 0)) if aside > 1.0 else ()
            moved = [box.translated(x * box.width, y * box.height) for x, y in (*wide, *shifts)]
            if self.put(label, moved):
                return

    def put(self, label: Text, places: Iterable[BboxBase]) -> bool:
        """Move a text to the first place that hides nothing, else to one that hides the path.

        Where all hide a mark or a text it goes to the first; returns False.
        """
        candidates = list(places)
        free = [box for box in candidates if self.is_free(box)]
        chosen = next((box for box in free if not self.hides_path(box)), None)
        chosen = chosen or (free or candidates)[0]
        corners = self.axes.transData.inverted().transform(chosen.get_points())
        label.set_position(corners.mean(axis=0))
        if free:
            self.boxes.append(chosen)
        return bool(free)

    def is_free(self, box: BboxBase) -> bool:
        """Tell whether a text in a box is within the picture and hides no mark and no text."""
        wide = box.padded(SPACE * self.point)
        inside = all(self.frame.contains(x, y) for x, y in wide.get_points())
        return inside and not any(wide.fully_overlaps(taken) for taken in self.boxes)

    def hides_path(self, box: BboxBase) -> bool:
        """Tell whether a box covers a point of the path."""
        covered = (box.min <= self.path) & (self.path <= box.max)
        return bool(covered.all(axis=1).any())

    def rotation(self, label: Text, shape: BaseGeometry) -> float:
        """Return 90 degrees for a name that fits into its place only upright, else 0."""
        label.set_rotation(0.0)
        box = label.get_window_extent()
        corners = np.reshape(shape.bounds, (2, 2))
        width, height = np.ptp(self.pixels(corners), axis=0)
        return 90.0 if box.width > width and height > 1.2 * max(width, box.height) else 0.0


def draw_places(axes: Axes, places: Places, project: Projection) -> None:
    """Draw the outline of each place."""
    for place in places:
        draw_outline(axes, place, shapely.transform(place.geometry, project))


def write_names(labels: Labels, places: Places, project: Projection) -> None:
    """Write the names of places, clear of each other and of what is taken."""
    shapes = [shapely.transform(place.geometry, project) for place in places]
    # The names of large places have more room to give way.
    for number in np.argsort([shape.area for shape in shapes], kind='stable'):
        labels.add_name(places.places[number].name, shapes[number])


def draw_outline(axes: Axes, place: Place, shape: BaseGeometry) -> None:
    """Draw the outline of a place, or a point."""
    colour = style.OBJECT if place.is_object else style.AREA
    if shape.geom_type == 'Point':
        axes.plot(shape.x, shape.y, 'P', color=colour, markersize=7, zorder=3)
        return
    draw_region(axes, shape, edgecolor=colour, facecolor=(colour, TINT), linewidth=1.2, zorder=2.5)


def draw_region(axes: Axes, shape: BaseGeometry, **look: object) -> None:
    """Draw a polygon, or several, in the coordinates of the axes; holes stay empty."""
    rings = [
        shapely.get_coordinates(ring)
        for part in shapely.get_parts(shape)
        if part.geom_type == 'Polygon' and not part.is_empty
        for ring in (part.exterior, *part.interiors)
    ]
    if rings:
        path = Path.make_compound_path(*(Path(ring, closed=True) for ring in rings))
        axes.add_patch(PathPatch(path, **look))


def places_figure(places: Places, grid_map: GridMap | None = None) -> Figure:
    """Return a figure of places, axes in metres, on their map where it is given."""
    shapes = [place.geometry.buffer(MARGIN) for place in places]
    x0, y0, x1, y1 = shapely.union_all(shapes).bounds if shapes else (0.0, 0.0, 1.0, 1.0)
    if grid_map is not None:
        whole = raster.MapWindow(0, 0, grid_map.width, grid_map.height)
        (x0, y0), (x1, y1) = raster.bounds_of(whole, raster.cells_to_metres(grid_map))
    aspect = (x1 - x0) / (y1 - y0)
    width = min(WIDTH, MAX_HEIGHT * aspect)
    size = max(WIDTH / 2, width), max(WIDTH / 2, width / aspect) + 0.5
    figure = Figure(figsize=size, layout='constrained')
    axes = figure.add_subplot(aspect='equal', xlabel='x (m)', ylabel='y (m)')
    if grid_map is not None:
        raster.draw_codes(
            axes, raster.cell_codes(grid_map), whole, raster.cells_to_metres(grid_map)
        )
    axes.set(xlim=(x0, x1), ylim=(y0, y1))
    draw_places(axes, places, lambda points: points)
    write_names(Labels(axes), places, lambda points: points)
    return figure
