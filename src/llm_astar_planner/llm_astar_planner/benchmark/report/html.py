"""The report as one self-contained HTML page: tables, figures inline, a browser of samples."""

from __future__ import annotations

import base64
import io
import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from jinja2 import Environment, PackageLoader
from llm_astar_msgs_adapter.maps.barrier_map import BarrierMap
from llm_astar_msgs_adapter.maps.grid_map import FREE, GridMap
from markupsafe import Markup
from PIL import Image

from llm_astar_planner.benchmark.analysis.scalability import Growth
from llm_astar_planner.benchmark.analysis.summary import CaseSummary, Contrast, by_case, place
from llm_astar_planner.benchmark.datasets.samples import ProblemMap
from llm_astar_planner.benchmark.report import markdown as tables
from llm_astar_planner.benchmark.report.figures import case_label, walled
from llm_astar_planner.benchmark.report.sentences import (
    growth_sentence,
    headline,
    recorded_sentence,
    sentence,
)
from llm_astar_planner.benchmark.results import Row
from llm_astar_planner.costmap.config import CostmapConfig

# As the page draws walls, and lighter what nobody has seen.
WALL_COLOUR, UNKNOWN_COLOUR = (31, 36, 48, 255), (154, 160, 172, 96)
MEDIA_TYPES = {'.png': 'image/png', '.gif': 'image/gif'}


def html_report(
    summaries: Sequence[CaseSummary],
    contrasts: Sequence[Contrast],
    growths: Sequence[Growth],
    metadata: Mapping[str, Any],
    *,
    rows: Sequence[Row],
    maps: Sequence[ProblemMap],
    rules: CostmapConfig | None = None,
    pictures: Sequence[tuple[Path, str]] = (),
) -> str:
    """Write the page; `pictures` are (file, caption). It asks the network for nothing.

    Grids are drawn by the `rules` of the run, without them by MovingAI's.
    """
    environment = Environment(
        loader=PackageLoader('llm_astar_planner', 'benchmark/report'), autoescape=True
    )
    growth_head, growth_rows = tables.growth_table(growths)
    page: str = environment.get_template('report.html.j2').render(
        title=tables.title(metadata),
        headline=_plain(headline(contrasts)),
        recorded=_plain(recorded_sentence(rows)),
        provenance=_plain(tables.provenance(metadata, summaries)),
        sentences=[_plain(sentence(contrast)) for contrast in contrasts if contrast.samples],
        main=(tables.TABLE_HEAD, tables.main_table(summaries)),
        added=(tables.CONTRAST_HEAD, tables.contrast_table(contrasts)),
        spread=(tables.SPREAD_HEAD, tables.spread_table(summaries)),
        waypoints=(tables.WAYPOINT_HEAD, tables.waypoint_table(summaries)),
        paths=(tables.PATH_HEAD, tables.path_table(summaries)),
        left_out=list(metadata.get('left_out') or []),
        notes=list(metadata.get('notes') or []),
        growth=(growth_head, growth_rows),
        grown=growth_sentence(growths),
        paper=(tables.TABLE_HEAD, () if metadata.get('bags') else tables.PAPER_TABLE),
        pictures=[(_inline(path), caption) for path, caption in pictures],
        data=_script_json(browser_data(rows, maps, rules)),
    )
    return page


def browser_data(
    rows: Sequence[Row], maps: Sequence[ProblemMap], rules: CostmapConfig | None
) -> dict[str, Any]:
    """Return what the browser of samples shows: maps, cases, and the rows of scale 1."""
    cases = dict(sorted(by_case(rows).items(), key=lambda item: place(item[0])))
    held = {problem.id: len(problem.samples) for problem in maps}
    samples = sorted(
        {(row.map, row.pair) for row in rows if row.scale == 1 and row.pair < held.get(row.map, 0)}
    )
    wanted = {map_id for map_id, _ in samples}
    return {
        'maps': {m.id: _map(m, rules) for m in maps if m.id in wanted},
        'cases': [case_label(case) for case in cases],
        'samples': [
            [
                *sample,
                [_entry(found.get(sample)) for found in cases.values()],
                *_recorded(next(found[sample] for found in cases.values() if sample in found)),
            ]
            for sample in samples
        ],
    }


def _recorded(row: Row) -> tuple[str, str]:
    """Return which request of a bag a row is of, and the path the robot itself planned then."""
    return f'{row.bag}, request {row.request}' if row.bag else '', row.recorded_path


def _map(problem: ProblemMap, rules: CostmapConfig | None) -> dict[str, Any]:
    """Describe a map in cells, counted from its corner: its barriers, or a picture of its grid."""
    pairs = [
        [*problem.to_cell(sample.start), *problem.to_cell(sample.goal), sample.query]
        for sample in problem.samples
    ]
    if not isinstance(problem, BarrierMap):
        grid_map = walled(problem.to_grid(), rules)
        return {
            'size': [grid_map.width, grid_map.height],
            'h': [],
            'v': [],
            'image': _picture(grid_map),
            'pairs': pairs,
        }
    (x_min, x_max), (y_min, y_max) = problem.range_x, problem.range_y
    return {
        'size': [x_max - x_min, y_max - y_min],
        'h': [[y - y_min, a - x_min, b - x_min] for y, a, b in problem.horizontal_barriers],
        'v': [[x - x_min, a - y_min, b - y_min] for x, a, b in problem.vertical_barriers],
        'pairs': pairs,
    }


def _picture(grid_map: GridMap) -> str:
    """Draw a grid, a pixel a cell, row 0 below: blocked dark, unknown grey, free clear."""
    pixels = np.zeros((*grid_map.cells.shape, 4), dtype=np.uint8)
    pixels[grid_map.cells < FREE] = UNKNOWN_COLOUR
    pixels[grid_map.blocked()] = WALL_COLOUR
    buffer = io.BytesIO()
    Image.fromarray(pixels[::-1]).quantize().save(buffer, 'PNG')
    return f'data:image/png;base64,{base64.b64encode(buffer.getvalue()).decode()}'


def _entry(row: Row | None) -> list[Any] | None:
    if row is None:
        return None
    numbers = [None if value != value else round(value, 3) for value in (  # noqa: PLR0124 - NaN
        row.operation, row.storage, row.length,
    )]  # fmt: skip
    return [row.code, *numbers, row.source_status, row.waypoints, row.verdicts, row.path]


def _plain(text: str) -> str:
    """Take Markdown's code marks out of a sentence."""
    return text.replace('`', '')


def _inline(path: Path) -> str:
    data = base64.b64encode(path.read_bytes()).decode()
    return f'data:{MEDIA_TYPES[path.suffix]};base64,{data}'


def _script_json(values: Mapping[str, Any]) -> Markup:
    """Write JSON that cannot end the script element it stands in, whatever a model wrote."""
    text = json.dumps(values, separators=(',', ':'), allow_nan=False)
    return Markup(text.replace('<', '\\u003c'))  # noqa: S704 - no < is left in it
