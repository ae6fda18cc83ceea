# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""The samples of a run that a page shows: maps, variants and rows, bounded in size."""

import base64
import io
import json
import math
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np
import shapely
from llm_astar_msgs_adapter.maps.barrier_map import BarrierMap
from llm_astar_msgs_adapter.maps.grid_map import GridMap
from llm_astar_msgs_adapter.maps.places import NO_PLACES, Places
from llm_astar_msgs_adapter.maps.problem_maps import ProblemMap
from llm_astar_planner.costmap.config import CostmapConfig
from PIL import Image
from shapely.geometry.base import BaseGeometry

from llm_astar_lab.analysis.summary import SampleId, by_variant
from llm_astar_lab.pictures import raster
from llm_astar_lab.report.sentences import variant_label
from llm_astar_lab.results.row import Row
from llm_astar_lab.results.stored_rows import StoredRows

# Characters of JSON that the samples may take; a page with all of a large run takes megabytes.
BUDGET = 500_000
# Bytes of rows that are kept to choose from.
MAX_KEPT = 32_000_000
# Pixels of a map's picture along its longer side, at most.
MAX_PIXELS = 1000


# The rows of the samples that a page may show, of so many samples that have a stored map.
ShownSamples = tuple[Sequence[Row], int]


def shown_samples(rows: Iterable[Row] | StoredRows, maps: Iterable[ProblemMap]) -> ShownSamples:
    """Keep the rows of scale 1 whose sample is stored in one of the maps.

    Where all would take over MAX_KEPT bytes, only every second sample is kept, every fourth and
    so on.
    """
    stored, pairs = StoredRows.of(rows), {item.id: len(item.samples) for item in maps}
    found = stored.arrays('sizes')
    limits = np.array([pairs.get(number, 0) for number in found['map'].tolist()], dtype=int)
    samples, every = np.flatnonzero(found['pair'] < limits), 1
    while found['size'][samples[::every]].sum() > MAX_KEPT and every < len(samples):
        every *= 2
    kept = samples[::every]
    chosen = set(zip(found['map'][kept].tolist(), found['pair'][kept].tolist()))
    of_chosen = (row for row in stored.rows('scale = 1') if (row.map, row.pair) in chosen)
    return list(of_chosen), len(samples)


def browser_data(
    shown: ShownSamples,
    maps: Sequence[ProblemMap],
    costmap: CostmapConfig | None,
    places: Places = NO_PLACES,
) -> dict[str, Any]:
    """Return what the browser of samples shows: maps, variants, and the rows of scale 1.

    Grids are drawn with the walls of `costmap`, by default MovingAI's; `places` are on every map.
    Of more than fit into BUDGET every second, third and so on is left out; `total` counts all.
    """
    rows, total = shown
    found = by_variant(rows)
    variants = {variant: found[variant] for variant in sorted(found, key=lambda v: v.report_order)}
    samples = sorted({(row.map, row.pair) for row in rows})
    wanted, every = {map_id for map_id, _ in samples}, 1
    drawn = {item.id: map_data(item, costmap, places) for item in maps if item.id in wanted}
    while True:
        chosen = samples[::every]
        of_chosen = {map_id for map_id, _ in chosen}
        data = {
            'maps': {number: values for number, values in drawn.items() if number in of_chosen},
            'cases': [variant_label(variant) for variant in variants],
            **samples_data([*variants.values()], chosen),
            'total': total,
        }
        size = len(json.dumps(data, separators=(',', ':')))
        if size <= BUDGET or len(chosen) < 2:
            return data
        every += max(1, every * (size - BUDGET) // BUDGET)


def samples_data(
    variants: Sequence[Mapping[SampleId, Row]], samples: Sequence[SampleId]
) -> dict[str, Any]:
    """Return the data of some samples. `strings` holds what their rows name by number."""
    strings: dict[str, int] = {}
    entries = []
    for sample in samples:
        of_sample = [found.get(sample) for found in variants]
        row = next(filter(None, of_sample))
        request = f'{row.bag}, request {row.request}' if row.bag else ''
        numbers = [row_data(item, strings) for item in of_sample]
        entries.append([*sample, numbers, request, row.recorded_path])
    return {'samples': entries, 'strings': list(strings)}


def row_data(row: Row | None, strings: dict[str, int]) -> list[Any] | None:
    """Return what the browser shows of a row; None where the variant did not run on a sample.

    Texts are added to `strings` and named by their number there: many rows share them.
    """
    if row is None:
        return None
    texts = (row.waypoints, row.verdicts, row.path, row.instruction, row.code, row.source_status)
    *places, code, status = (strings.setdefault(text, len(strings)) for text in texts)
    figures = (row.operation, row.storage, row.length)
    numbers = [None if math.isnan(value) else round(value, 2) for value in figures]
    return [code, *numbers, status, *places]


def map_data(problem: ProblemMap, costmap: CostmapConfig | None, places: Places) -> dict[str, Any]:
    """Return a map in cells, counted from its corner: its barriers, or a picture of its grid."""
    to_cell = problem.to_cell
    pairs = [[*to_cell(sample.start), *to_cell(sample.goal)] for sample in problem.samples]
    data: dict[str, Any] = {'pairs': pairs, 'places': places_data(problem, places)}
    if not isinstance(problem, BarrierMap):
        grid_map = raster.drawable_map(problem.to_grid(), costmap)
        size = [grid_map.width, grid_map.height]
        return {'size': size, 'h': [], 'v': [], 'image': grid_image(grid_map), **data}
    x_min, y_min = problem.offset
    return {
        'size': list(problem.size),
        'h': [[y - y_min, a - x_min, b - x_min] for y, a, b in problem.horizontal_barriers],
        'v': [[x - x_min, a - y_min, b - y_min] for x, a, b in problem.vertical_barriers],
        **data,
    }


def places_data(problem: ProblemMap, places: Places) -> list[list[Any]]:
    """Return names and rings of places in cells; a point is a ring of one corner."""
    if not len(places):
        return []
    to_cells = problem.to_grid().world_to_grid

    def cells(shape: BaseGeometry) -> Any:  # noqa: ANN401 - nested lists
        return to_cells(shapely.get_coordinates(shape)).round(2).tolist()

    return [
        [
            place.name,
            cells(place.geometry.representative_point())[0],
            [cells(getattr(p, 'exterior', p)) for p in shapely.get_parts(place.geometry)],
        ]
        for place in places
    ]


def grid_image(grid_map: GridMap) -> str:
    """Draw a grid with row 0 at the bottom, a pixel a cell or less; return it as a data URL."""
    codes = raster.cell_codes(grid_map)
    part = min(1.0, MAX_PIXELS / max(codes.shape))
    width, height = (max(1, int(part * side)) for side in (grid_map.width, grid_map.height))
    image = Image.fromarray(raster.resize(codes, width, height)[::-1].copy(), 'P')
    image.putpalette(raster.PALETTE.ravel().tolist())
    buffer = io.BytesIO()
    image.save(buffer, 'PNG', optimize=True)
    return f'data:image/png;base64,{base64.b64encode(buffer.getvalue()).decode()}'
