"""The report as one self-contained HTML page: tables, inline figures, a browser of samples."""

from __future__ import annotations

import base64
import io
import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import shapely
from jinja2 import Environment, PackageLoader
from llm_astar_msgs_adapter.maps.barrier_map import BarrierMap
from llm_astar_msgs_adapter.maps.grid_map import FREE, GridMap
from llm_astar_msgs_adapter.maps.places import NO_PLACES, Places
from markupsafe import Markup
from PIL import Image

from llm_astar_planner.benchmark.analysis.summary import (
    Growth,
    PairedComparison,
    VariantSummary,
    by_variant,
    report_order,
)
from llm_astar_planner.benchmark.datasets.samples import ProblemMap
from llm_astar_planner.benchmark.report import markdown as tables
from llm_astar_planner.benchmark.report.figures import variant_label
from llm_astar_planner.benchmark.report.sentences import (
    growth_sentence,
    headline,
    recorded_sentence,
    sentence,
)
from llm_astar_planner.benchmark.results import Row
from llm_astar_planner.costmap.config import CostmapConfig
from llm_astar_planner.visualization.figures import drawable_map

# RGBA of walls and of unknown cells.
WALL_COLOUR, UNKNOWN_COLOUR = (31, 36, 48, 255), (154, 160, 172, 96)
MEDIA_TYPES = {'.png': 'image/png', '.gif': 'image/gif'}


def html_report(
    summaries: Sequence[VariantSummary],
    comparisons: Sequence[PairedComparison],
    growths: Sequence[Growth],
    metadata: Mapping[str, Any],
    *,
    rows: Sequence[Row],
    maps: Sequence[ProblemMap],
    costmap: CostmapConfig | None = None,
    places: Places = NO_PLACES,
    pictures: Sequence[tuple[Path, str]] = (),
) -> str:
    """Return the page, which loads nothing from the network; `pictures` are (file, caption).

    Grids are drawn with the walls of the run's `costmap` rules, by default MovingAI's. `places`
    are drawn on every map.
    """
    environment = Environment(
        loader=PackageLoader('llm_astar_planner', 'benchmark/report'), autoescape=True
    )
    growth_head, growth_rows = tables.growth_table(growths)
    page: str = environment.get_template('report.html.j2').render(
        title=tables.report_title(metadata),
        headline=without_code_marks(headline(comparisons)),
        recorded=without_code_marks(recorded_sentence(rows) or ''),
        provenance=without_code_marks(tables.provenance(metadata, summaries)),
        sentences=[
            without_code_marks(sentence(comparison))
            for comparison in comparisons
            if comparison.samples
        ],
        main=(tables.TABLE_HEAD, tables.main_table(summaries)),
        added=(tables.COMPARISON_HEAD, tables.comparison_table(comparisons)),
        spread=(tables.SPREAD_HEAD, tables.spread_table(summaries)),
        waypoints=(tables.WAYPOINT_HEAD, tables.waypoint_table(summaries)),
        paths=(tables.PATH_HEAD, tables.path_table(summaries)),
        left_out=list(metadata.get('left_out') or []),
        notes=list(metadata.get('notes') or []),
        growth=(growth_head, growth_rows),
        grown=growth_sentence(growths) or '',
        paper=(tables.TABLE_HEAD, () if metadata.get('bags') else tables.PAPER_TABLE),
        pictures=[
            (data_url(path.read_bytes(), MEDIA_TYPES[path.suffix]), caption)
            for path, caption in pictures
        ],
        data=script_json(browser_data(rows, maps, costmap, places)),
    )
    return page


def browser_data(
    rows: Sequence[Row],
    maps: Sequence[ProblemMap],
    costmap: CostmapConfig | None,
    places: Places,
) -> dict[str, Any]:
    """Return what the browser of samples shows: maps, variants, and the rows of scale 1."""
    variants = dict(sorted(by_variant(rows).items(), key=lambda item: report_order(item[0])))
    stored = {problem.id: len(problem.samples) for problem in maps}
    shown = [row for row in rows if row.scale == 1 and row.pair < stored.get(row.map, 0)]
    samples = sorted({(row.map, row.pair) for row in shown})
    wanted = {map_id for map_id, _ in samples}
    entries = []
    for sample in samples:
        of_sample = [found.get(sample) for found in variants.values()]
        row = next(item for item in of_sample if item is not None)
        request = f'{row.bag}, request {row.request}' if row.bag else ''
        entries.append([*sample, list(map(row_data, of_sample)), request, row.recorded_path])
    return {
        'maps': {
            m.id: map_data(m, costmap) | {'places': places_data(m, places)}
            for m in maps
            if m.id in wanted
        },
        'cases': [variant_label(variant) for variant in variants],
        'samples': entries,
    }


def map_data(problem: ProblemMap, costmap: CostmapConfig | None) -> dict[str, Any]:
    """Return a map in cells, counted from its corner: its barriers, or a picture of its grid."""
    pairs = [
        [*problem.to_cell(sample.start), *problem.to_cell(sample.goal), sample.query]
        for sample in problem.samples
    ]
    if not isinstance(problem, BarrierMap):
        grid_map = drawable_map(problem.to_grid(), costmap)
        size = [grid_map.width, grid_map.height]
        return {'size': size, 'h': [], 'v': [], 'image': grid_image(grid_map), 'pairs': pairs}
    (x_min, x_max), (y_min, y_max) = problem.range_x, problem.range_y
    return {
        'size': [x_max - x_min, y_max - y_min],
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
    """Draw a grid with one pixel per cell and row 0 at the bottom; return it as a data URL."""
    pixels = np.zeros((*grid_map.cells.shape, 4), dtype=np.uint8)
    pixels[grid_map.cells < FREE] = UNKNOWN_COLOUR
    pixels[grid_map.blocked()] = WALL_COLOUR
    buffer = io.BytesIO()
    Image.fromarray(pixels[::-1]).quantize().save(buffer, 'PNG')
    return data_url(buffer.getvalue(), 'image/png')


def row_data(row: Row | None) -> list[Any] | None:
    """Return what the browser shows of a row; None where the variant did not run on a sample."""
    if row is None:
        return None
    numbers = [None if value != value else round(value, 3) for value in (  # noqa: PLR0124 - NaN
        row.operation, row.storage, row.length,
    )]  # fmt: skip
    return [
        row.code, *numbers, row.source_status, row.waypoints, row.verdicts, row.path,
        row.instruction,
    ]  # fmt: skip


def without_code_marks(text: str) -> str:
    """Remove Markdown's code marks from a sentence."""
    return text.replace('`', '')


def data_url(content: bytes, media_type: str) -> str:
    """Return content as a URL that holds it."""
    return f'data:{media_type};base64,{base64.b64encode(content).decode()}'


def script_json(values: Mapping[str, Any]) -> Markup:
    """Return JSON that cannot close the enclosing script element, whatever a model wrote."""
    text = json.dumps(values, separators=(',', ':'), allow_nan=False)
    return Markup(text.replace('<', '\\u003c'))  # noqa: S704 - it holds no <
