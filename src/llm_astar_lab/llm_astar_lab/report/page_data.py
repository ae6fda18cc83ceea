"""What the browser of samples on a report's page shows: maps, variants, rows; bounded in size."""

from __future__ import annotations

import base64
import io
import json
from collections.abc import Iterable, Sequence
from itertools import groupby
from typing import Any, NamedTuple

import numpy as np
import shapely
from llm_astar_msgs_adapter.maps.barrier_map import BarrierMap
from llm_astar_msgs_adapter.maps.grid_map import GridMap
from llm_astar_msgs_adapter.maps.places import NO_PLACES, Places
from llm_astar_msgs_adapter.maps.problem_maps import ProblemMap
from llm_astar_planner.costmap.config import CostmapConfig
from PIL import Image

from llm_astar_lab.analysis.summary import by_variant, report_order
from llm_astar_lab.pictures import raster
from llm_astar_lab.pictures.figures import drawable_map
from llm_astar_lab.report.sentences import variant_label
from llm_astar_lab.results.row import Row

# Characters of JSON that the samples may take; a page with all of a large run takes megabytes.
BUDGET = 500_000
# Bytes of rows that are kept to choose from, and of a row without its texts.
MAX_KEPT, ROW_BYTES = 32_000_000, 900
# Pixels of a map's picture along its longer side, at most.
MAX_PIXELS = 1000


class ShownSamples(NamedTuple):
    """The rows of the samples that a page may show, of `total` samples that have a stored map."""

    rows: Sequence[Row]
    total: int


NO_SAMPLES = ShownSamples((), 0)


def shown_samples(rows: Iterable[Row], maps: Iterable[ProblemMap]) -> ShownSamples:
    """Read rows once and keep those of scale 1 whose sample is stored in one of the maps.

    Rows are in order of map and pair. Where all would take over MAX_KEPT bytes, only every
    second sample is kept, every fourth and so on.
    """
    stored = {problem.id: len(problem.samples) for problem in maps}
    drawable = (row for row in rows if row.scale == 1 and row.pair < stored.get(row.map, 0))
    kept: list[list[Row]] = []
    every, total, size = 1, 0, 0
    for _, of_sample in groupby(drawable, key=lambda row: (row.map, row.pair)):
        if total % every == 0:
            kept.append(list(of_sample))
            size += sum(map(row_size, kept[-1]))
        total += 1
        while size > MAX_KEPT and len(kept) > 1:
            every, kept = 2 * every, kept[::2]
            size = sum(row_size(row) for group in kept for row in group)
    return ShownSamples([row for group in kept for row in group], total)


def row_size(row: Row) -> int:
    """Return about how many bytes a row takes in memory."""
    return ROW_BYTES + len(row.waypoints) + len(row.path) + len(row.recorded_path)


def browser_data(
    shown: ShownSamples,
    maps: Sequence[ProblemMap],
    costmap: CostmapConfig | None,
    places: Places = NO_PLACES,
) -> dict[str, Any]:
    """Return what the browser of samples shows: maps, variants, and the rows of scale 1.

    Of more than fit into BUDGET every second, third and so on is left out; `total` counts all.
    """
    every = 1
    while True:
        data = samples_data(shown, maps, costmap, places, every)
        size = len(json.dumps(data, separators=(',', ':')))
        if size <= BUDGET or len(data['samples']) < 2:
            return data
        every += max(1, every * (size - BUDGET) // BUDGET)


def samples_data(
    shown: ShownSamples,
    maps: Sequence[ProblemMap],
    costmap: CostmapConfig | None,
    places: Places,
    every: int,
) -> dict[str, Any]:
    """Return the data of `every` so many-th sample. `strings` holds what rows name by number."""
    variants = dict(sorted(by_variant(shown.rows).items(), key=lambda item: report_order(item[0])))
    samples = sorted({(row.map, row.pair) for row in shown.rows})[::every]
    wanted = {map_id for map_id, _ in samples}
    strings: dict[str, int] = {}
    entries = []
    for sample in samples:
        of_sample = [found.get(sample) for found in variants.values()]
        row = next(item for item in of_sample if item is not None)
        request = f'{row.bag}, request {row.request}' if row.bag else ''
        entries.append(
            [*sample, [row_data(item, strings) for item in of_sample], request, row.recorded_path]
        )
    return {
        'maps': {
            m.id: map_data(m, costmap) | {'places': places_data(m, places)}
            for m in maps
            if m.id in wanted
        },
        'cases': [variant_label(variant) for variant in variants],
        'samples': entries,
        'strings': list(strings),
        'total': shown.total,
    }


def map_data(problem: ProblemMap, costmap: CostmapConfig | None) -> dict[str, Any]:
    """Return a map in cells, counted from its corner: its barriers, or a picture of its grid."""
    pairs = [
        [*problem.to_cell(sample.start), *problem.to_cell(sample.goal)]
        for sample in problem.samples
    ]
    if not isinstance(problem, BarrierMap):
        grid_map = drawable_map(problem.to_grid(), costmap)
        size = [grid_map.width, grid_map.height]
        return {'size': size, 'h': [], 'v': [], 'image': grid_image(grid_map), 'pairs': pairs}
    x_min, y_min = problem.offset
    return {
        'size': list(problem.size),
        'h': [[y - y_min, a - x_min, b - x_min] for y, a, b in problem.horizontal_barriers],
        'v': [[x - x_min, a - y_min, b - y_min] for x, a, b in problem.vertical_barriers],
        'pairs': pairs,
    }


def places_data(problem: ProblemMap, places: Places) -> list[list[Any]]:
    """Return names and rings of places in cells; a point is a ring of one corner."""
    if not len(places):
        return []
    grid_map = problem.to_grid()
    found: list[list[Any]] = []
    for place in places:
        rings = []
        for part in shapely.get_parts(place.geometry):
            corners = shapely.get_coordinates(getattr(part, 'exterior', part))
            rings.append(grid_map.world_to_grid(corners).round(2).tolist())
        middle = place.geometry.representative_point()
        (centre,) = grid_map.world_to_grid([(middle.x, middle.y)]).round(2).tolist()
        found.append([place.name, centre, rings])
    return found


def grid_image(grid_map: GridMap) -> str:
    """Draw a grid with row 0 at the bottom, a pixel a cell or less; return it as a data URL."""
    codes = raster.cell_codes(grid_map, np.zeros((0, 0), dtype=np.bool_))
    part = min(1.0, MAX_PIXELS / max(codes.shape))
    width, height = (max(1, int(part * side)) for side in (grid_map.width, grid_map.height))
    image = Image.fromarray(raster.resize(codes, width, height)[::-1].copy(), 'P')
    image.putpalette(raster.PALETTE.ravel().tolist())
    buffer = io.BytesIO()
    image.save(buffer, 'PNG', optimize=True)
    return data_url(buffer.getvalue(), 'image/png')


def row_data(row: Row | None, strings: dict[str, int]) -> list[Any] | None:
    """Return what the browser shows of a row; None where the variant did not run on a sample.

    Texts are added to `strings` and named by their number there: many rows share them.
    """
    if row is None:
        return None
    numbers = [None if value != value else round(value, 2) for value in (  # noqa: PLR0124 - NaN
        row.operation, row.storage, row.length,
    )]  # fmt: skip
    texts = (row.waypoints, row.verdicts, row.path, row.instruction)
    places = [strings.setdefault(text, len(strings)) for text in texts]
    return [
        strings.setdefault(row.code, len(strings)),
        *numbers,
        strings.setdefault(row.source_status, len(strings)),
        *places,
    ]


def data_url(content: bytes, media_type: str) -> str:
    """Return content as a URL that holds it."""
    return f'data:{media_type};base64,{base64.b64encode(content).decode()}'
