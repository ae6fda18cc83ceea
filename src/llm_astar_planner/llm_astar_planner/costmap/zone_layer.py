# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""Composes zones and Nav2's costmap filter masks, keepout areas and speed limits, onto maps.

The rules of masks are those of nav2_costmap_2d's KeepoutFilter and SpeedFilter. A speed limit
becomes a cost, since a robot that drives at p percent of its speed takes 100 / p times as long.
"""

import math
from collections.abc import Iterable, Iterator
from enum import IntEnum
from typing import NamedTuple

import numpy as np
from llm_astar_msgs_adapter.maps.grid_map import BORDER_TOLERANCE, UNKNOWN, GridMap

from llm_astar_planner.costmap import _kernels as kernels
from llm_astar_planner.costmap.config import HIGHEST_COST, CostmapConfig
from llm_astar_planner.costmap.raster import Window, cover_window, window_of
from llm_astar_planner.costmap.zone_rules import forbidden_moves
from llm_astar_planner.costmap.zones import (
    KEEPOUT,
    PREFERRED,
    RULES,
    Zone,
    Zones,
    ZonesError,
    zones_from_text,
)
from llm_astar_planner.search.arrays import Bools, Int8s, Int64s, Uint8s

# A value of the mask that leaves a cell as it is.
TRANSPARENT = -1


class FilterKind(IntEnum):
    """`type` of nav2_msgs/CostmapFilterInfo."""

    KEEPOUT = 0
    SPEED_PERCENT = 1
    SPEED_ABSOLUTE = 2


class FilterInfo(NamedTuple):
    """What a nav2_msgs/CostmapFilterInfo says about a mask: value * multiplier + base.

    `topic` is where the mask is published. KeepoutFilter uses neither base nor multiplier.
    """

    kind: FilterKind
    topic: str
    base: float = 0.0
    multiplier: float = 1.0


class FilterMask(NamedTuple):
    """A mask and what it means."""

    info: FilterInfo
    grid_map: GridMap


def filter_info(kind: int, topic: str, base: float, multiplier: float) -> FilterInfo:
    """Return the fields of a CostmapFilterInfo, checked. Raises ZonesError."""
    if kind not in tuple(FilterKind):
        kinds = '0 (keepout), 1 (speed in percent), 2 (speed in m/s)'
        raise ZonesError(f'type: {kind} is none of {kinds}')
    if not topic:
        raise ZonesError('filter_mask_topic: is empty; name the topic of the mask')
    if not (math.isfinite(base) and math.isfinite(multiplier)):
        raise ZonesError(f'base, multiplier: {base}, {multiplier} are not finite')
    return FilterInfo(FilterKind(kind), topic, base, multiplier)


def mask_costs(info: FilterInfo, config: CostmapConfig, max_speed: float) -> Int8s:
    """Return what each value of a mask, 0 to 100, costs: int8 [101], TRANSPARENT for nothing.

    `max_speed` is the robot's, in m/s. Raises ZonesError for limits in m/s without it.
    """
    values = np.arange(KEEPOUT + 1)
    if info.kind is FilterKind.KEEPOUT:
        return np.where(values > 0, zone_costs(values, config), TRANSPARENT).astype(np.int8)
    percent = info.base + info.multiplier * values
    if info.kind is FilterKind.SPEED_ABSOLUTE:
        if not max_speed > 0.0:
            raise ZonesError("speed limits in m/s need the robot's: set the parameter max_speed")
        percent *= 100.0 / max_speed
    # As in SpeedFilter: value 0, a limit of 0 and one out of range are no limit.
    limited = (values > 0) & (percent > 0.0) & (percent < 100.0)
    factor = config.cost_travel_multiplier
    if factor == 0.0:
        return np.full(len(values), TRANSPARENT, dtype=np.int8)
    costs = 100.0 * (100.0 / np.where(limited, percent, 100.0) - 1.0) / factor
    capped = np.minimum(np.rint(costs), highest_cost(config))
    return np.where(limited & (capped > 0), capped, TRANSPARENT).astype(np.int8)


def zone_costs(costs: Int64s, config: CostmapConfig) -> Int64s:
    """Return the occupancy that makes cells cost this much: only KEEPOUT closes a cell."""
    return np.where(costs >= KEEPOUT, KEEPOUT, np.minimum(costs, highest_cost(config)))


def highest_cost(config: CostmapConfig) -> int:
    """Return the highest occupancy of a cell that is open."""
    return min(HIGHEST_COST, config.occupied_threshold - 1)


# Zones of a map that are named in a report.
MOST_NAMED = 20
# Cells in the boxes around all zones: a second's work.
MOST_CELLS = 400_000_000


class ZoneLayer:
    """What zones and masks cost on the cells of maps that lie as the first one does. Immutable.

    A zone covers all cells that it touches, so no strip of a keepout zone is open. A mask's value
    counts at the centre of a cell, as in Nav2. Where several overlap, the highest cost counts.
    """

    def __init__(
        self,
        layout: GridMap,
        zones: Iterable[Zone] = (),
        masks: Iterable[FilterMask] = (),
        config: CostmapConfig | None = None,
        max_speed: float = 0.0,
    ) -> None:
        """Take the size and place of a map, and the masks in its frame, in O(cells covered).

        `config` are the rules by which the map is planned on, `max_speed` is in m/s. Raises
        ZonesError for a mask of speeds in m/s without it, and for zones over MOST_CELLS.
        """
        self.config = config or CostmapConfig()
        self.rules = self.config, max_speed
        self._layout = layout.layout
        covered = [(zone, window_of(zone.area, layout)) for zone in zones]
        self.zones = [(zone, window) for zone, window in covered if has_cells(window)]
        check_size(window for _, window in self.zones)
        self.masks = [(mask, mask_costs(mask.info, self.config, max_speed)) for mask in masks]
        whole = Window(0, layout.height, 0, layout.width)
        is_whole = self.masks or any(zone.kind == PREFERRED for zone, _ in self.zones)
        self._window = whole if is_whole else union(window for _, window in self.zones)
        top, bottom, left, right = self._window
        self._costs = np.full((bottom - top, right - left), TRANSPARENT, dtype=np.int8)
        for mask, table in self.masks:
            paint_mask(mask.grid_map, table, layout, self._costs)
        for zone, window, cells in self.raised(layout):
            costs = zone_costs(np.array(zone.cost), self.config).astype(np.int8)
            inside = self._costs[window.slices(top, left)]
            np.maximum(inside, np.where(cells, costs, TRANSPARENT), out=inside)
        # Of each rule the zone, its part of the map, and the moves that it forbids there.
        self.rules_of = [
            (zone, *forbidden_moves(zone, window, layout))
            for zone, window in self.zones
            if zone.kind in RULES
        ]
        self.forbidden = np.zeros(layout.cells.shape if self.rules_of else (0, 0), dtype=np.uint8)
        for _, part, moves in self.rules_of:
            self.forbidden[part] |= moves
        self.forbidden.flags.writeable = False

    def fits(self, grid_map: GridMap) -> bool:
        """Tell whether the layer lies on this map as on its own."""
        return self._layout == grid_map.layout

    def compose(self, grid_map: GridMap) -> GridMap:
        """Return a map with the zones and masks: each cell has its own cost or theirs if higher.

        An unknown cell stays unknown where it costs more as that, and unless `allow_unknown`
        everywhere but in keepout zones. `zones` of the map returned names the zones on it.
        """
        if not self._costs.size:
            return grid_map
        cells = grid_map.cells.copy()
        part = cells[self._window.slices()]
        least = self.config.unknown_cost + 1 if self.config.allow_unknown else KEEPOUT
        is_kept = (part < 0) & (self._costs < least)
        np.maximum(part, self._costs, out=part)
        part[is_kept] = UNKNOWN
        cells.flags.writeable = False
        return GridMap(
            cells, grid_map.resolution, grid_map.origin, grid_map.frame_id, tuple(self._names()),
            ComposedZones(grid_map, self),
        )  # fmt: skip

    def _names(self) -> Iterator[str]:
        """Yield the labels of the zones on the map, the first MOST_NAMED of them."""
        for zone, _ in self.zones[:MOST_NAMED]:
            yield zone.label
        if len(self.zones) > MOST_NAMED:
            yield f'and {len(self.zones) - MOST_NAMED} more'

    def raised(self, layout: GridMap, least: int = 1) -> Iterator[tuple[Zone, Window, Bools]]:
        """Yield each zone of at least a cost, a window of the map, and which cells there have it.

        Of preferred lines the dearest has the cells that none of them touches.
        """
        roads = [pair for pair in self.zones if pair[0].kind == PREFERRED]
        dearest = max((zone for zone, _ in roads), key=lambda zone: zone.cost, default=None)
        if dearest is not None and dearest.cost >= least:
            off = np.ones(layout.cells.shape, dtype=np.bool_)
            for zone, window in roads:
                off[window.slices()] &= ~cover_window(zone.area, layout, window).touched
            yield dearest, Window(0, layout.height, 0, layout.width), off
        for zone, window in self.zones:
            if zone.kind != PREFERRED and zone.cost >= least:
                yield zone, window, cover_window(zone.area, layout, window).touched


class ComposedZones(NamedTuple):
    """A map, and the layer that was composed onto it."""

    base: GridMap
    layer: ZoneLayer

    @property
    def forbidden(self) -> Uint8s:
        """What `Composed.forbidden` is."""
        return self.layer.forbidden

    def closed(self) -> Iterator[tuple[str, str, tuple[slice, slice], Bools]]:
        """Yield what `Composed.closed` does."""
        for zone, window, cells in self.layer.raised(self.base, KEEPOUT):
            yield 'zone', zone.label, window.slices(), cells
        whole = slice(0, self.base.height), slice(0, self.base.width)
        for mask, table in self.layer.masks:
            costs = np.full(self.base.cells.shape, TRANSPARENT, dtype=np.int8)
            paint_mask(mask.grid_map, table, self.base, costs)
            yield 'mask', mask.info.topic, whole, costs >= KEEPOUT

    def rules(self) -> Iterator[tuple[str, str, tuple[slice, slice], Uint8s]]:
        """Yield what `Composed.rules` does."""
        for zone, window, moves in self.layer.rules_of:
            yield zone.kind, zone.label, window, moves

    def without_each(self) -> Iterator[tuple[str, GridMap]]:
        """Yield what `Composed.without_each` does."""
        masks, rules = [mask for mask, _ in self.layer.masks], self.layer.rules
        for zone, _ in self.layer.zones:
            left = [other for other, _ in self.layer.zones if other is not zone]
            yield zone.label, ZoneLayer(self.base, left, masks, *rules).compose(self.base)


def with_zones(grid_map: GridMap, text: str, config: CostmapConfig) -> GridMap:
    """Return a map with the zones of a GeoJSON text in its frame. Raises ZonesError."""
    zones, frame_id = zones_from_text(text)
    if frame_id not in ('', grid_map.frame_id):
        raise ZonesError(f'zones: frame_id: {frame_id!r} is not {grid_map.frame_id!r} of the map')
    return ZoneLayer(grid_map, Zones(zones), config=config).compose(grid_map)


def has_cells(window: Window) -> bool:
    """Tell whether there is a cell in a window."""
    return window.top < window.bottom and window.left < window.right


def check_size(windows: Iterable[Window]) -> None:
    """Raise ZonesError if there are more cells in windows than can be looked at in time."""
    count = sum((bottom - top) * (right - left) for top, bottom, left, right in windows)
    if count > MOST_CELLS:
        raise ZonesError(
            f'the boxes around all zones have {count / 1e6:.0f} million cells of the map, over '
            f'{MOST_CELLS / 1e6:.0f}; remove some, or make one zone of several'
        )


def union(windows: Iterable[Window]) -> Window:
    """Return the smallest window that holds all windows."""
    sides = list(zip(*windows))
    if not sides:
        return Window(0, 0, 0, 0)
    tops, bottoms, lefts, rights = sides
    return Window(min(tops), max(bottoms), min(lefts), max(rights))


def paint_mask(mask: GridMap, table: Int8s, layout: GridMap, costs: Int8s) -> None:
    """Raise `costs` [height, width] to what the mask's value at the centre of each cell costs."""
    corner, right, up = mask.world_to_grid(layout.grid_to_world([[0, 0], [1, 0], [0, 1]]))
    # From grid coordinates to numbers of cells.
    first = corner + 0.5 + BORDER_TOLERANCE
    kernels.raise_to_mask(mask.cells, table, first, right - corner, up - corner, costs)
