"""The report as one self-contained HTML page: the finding, figures, folded tables, samples."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from jinja2 import Environment, PackageLoader
from llm_astar_msgs_adapter.maps.places import NO_PLACES, Places
from llm_astar_msgs_adapter.maps.problem_maps import ProblemMap
from llm_astar_planner.costmap.config import CostmapConfig
from markupsafe import Markup

from llm_astar_lab.analysis.summary import RunSummary, VariantSummary, is_baseline
from llm_astar_lab.pictures import style
from llm_astar_lab.report.figures import has_waypoints
from llm_astar_lab.report.formats import TextRows, texts_of, without_constant_columns
from llm_astar_lab.report.markdown import provenance, report_title
from llm_astar_lab.report.page_data import (
    NO_SAMPLES,
    ShownSamples,
    browser_data,
    data_url,
)
from llm_astar_lab.report.sentences import (
    growth_sentence,
    headline,
    sentence,
    variant_label,
)
from llm_astar_lab.report.table import Table
from llm_astar_lab.report.tables import report_tables

MEDIA_TYPES = {'.png': 'image/png', '.gif': 'image/gif'}
# How the files of single methods of the drawn sample begin.
PANEL = 'panel_'
PICTURE_TITLES = {
    'search': 'The searches at work, animated',
    'growth': 'Growth with the scale of the map, drawn',
    'showcase': 'LLM-A* target by target, an example',
}
# Variants in the first figure, and the sources that it shows where there are more.
MAX_BARS = 12
SHOWN_SOURCES = ('none', 'oracle', 'random')
GLYPHS = {
    'square': '■',
    'diamond': '◆',
    'triangle': '▲',
    'star': '★',
    'plus': '✚',
    'triangle down': '▼',
    'cross': '✖',
    'hexagon': '⬢',
}


class Bar(NamedTuple):
    """A bar of the first figure: all ends in percent of the longest one."""

    label: str
    work: str
    length: str
    end: float
    low: float
    high: float
    has_waypoints: bool


def html_report(
    run: RunSummary,
    *,
    shown: ShownSamples = NO_SAMPLES,
    maps: Sequence[ProblemMap] = (),
    recorded: str | None = None,
    costmap: CostmapConfig | None = None,
    places: Places = NO_PLACES,
    pictures: Sequence[tuple[Path, str]] = (),
) -> str:
    """Return the page, which loads nothing from the network; `pictures` are (file, caption).

    Grids are drawn with the walls of the run's `costmap` rules, by default MovingAI's. `places`
    are drawn on every map.
    """
    environment = Environment(loader=PackageLoader('llm_astar_lab', 'report'), autoescape=True)
    bars, mark = work_bars(run.variants)
    page: str = environment.get_template('report.html.j2').render(
        title=report_title(run.metadata),
        headline=without_code_marks(headline(run.comparisons)),
        recorded=without_code_marks(recorded or ''),
        provenance=without_code_marks(provenance(run)),
        bars=bars,
        mark_100=mark,
        sentences=[
            without_code_marks(sentence(comparison))
            for comparison in run.comparisons
            if comparison.samples
        ],
        tables=[shown_table(table) for table in report_tables(run)],
        left_out=list(run.metadata.get('left_out') or []),
        notes=list(run.metadata.get('notes') or []),
        grown=growth_sentence(run.growths) or '',
        style=style,
        glyphs=GLYPHS,
        zone=[(style.INFLATED, 'inflated zone')] if costmap and costmap.robot_radius else [],
        data=script_json(browser_data(shown, maps, costmap, places)),
        colours=script_json(style.page_colours()),
        **page_pictures(pictures),
    )
    return page


def page_pictures(pictures: Sequence[tuple[Path, str]]) -> dict[str, Any]:
    """Return the pictures that the page shows: the panels of one sample, and others."""
    panels, others, where = [], [], ''
    for path, caption in pictures:
        if path.stem == 'compare':
            where = caption
        elif path.stem != 'ratios':
            data = data_url(path.read_bytes(), MEDIA_TYPES[path.suffix])
            if path.name.startswith(PANEL):
                panels.append((data, caption))
            else:
                others.append((data, caption, PICTURE_TITLES.get(path.stem, caption)))
    return {'panels': panels, 'pictures': others, 'where': where}


def work_bars(summaries: Sequence[VariantSummary]) -> tuple[list[Bar], float]:
    """Return the bars of the expansions against A*, and where 100 % is on their scale."""
    shown = [summary for summary in summaries if summary.operation.mean.value > 0]
    if len(shown) > MAX_BARS:
        shown = [item for item in shown if is_shown(item)]
    ends_of = [end for item in shown for end in item.operation.mean if end == end]  # noqa: PLR0124 - NaN
    longest = max([1.0, *ends_of])
    bars = []
    for summary in shown:
        mean, length = summary.operation.mean, summary.length.mean
        low, high = (end if end == end else mean.value for end in mean[1:])  # noqa: PLR0124 - NaN
        label, led = variant_label(summary.variant), has_waypoints(summary.variant)
        end, low, high = (min(100.0, 100 * end / longest) for end in (mean.value, low, high))
        texts = f'{100 * mean.value:.1f} %', f'{100 * (length.value - 1):+.2f} %'
        bars.append(Bar(label, *texts, end, low, high, led))
    return bars, 100.0 / longest


def is_shown(summary: VariantSummary) -> bool:
    """Tell whether a variant is in the first figure where there are many."""
    source = summary.variant.source
    return source in SHOWN_SOURCES or not (is_baseline(summary.variant) or '-best-' in source)


class ShownTable(NamedTuple):
    """A folded table: its name, title and note, head and rows, and what all rows share."""

    name: str
    title: str
    note: str
    head: tuple[str, ...]
    rows: TextRows
    common: str


def shown_table(table: Table) -> ShownTable:
    """Return a table without the columns that say the same in every row."""
    shown, common = without_constant_columns(table)
    return ShownTable(table.name, table.title, table.note, *texts_of(shown), common)


def without_code_marks(text: str) -> str:
    """Remove Markdown's code marks from a sentence."""
    return text.replace('`', '')


def script_json(values: Mapping[str, Any]) -> Markup:
    """Return JSON that cannot close the enclosing script element, whatever a model wrote."""
    text = json.dumps(values, separators=(',', ':'), allow_nan=False)
    return Markup(text.replace('<', '\\u003c'))  # noqa: S704 - it holds no <
