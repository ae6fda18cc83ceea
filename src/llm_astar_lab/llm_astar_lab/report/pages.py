# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""The report as Markdown, as one self-contained HTML page, and as text for a terminal."""

from __future__ import annotations

import base64
import json
import math
import re
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from types import MappingProxyType
from typing import Any

from jinja2 import Environment, PackageLoader, select_autoescape
from markupsafe import Markup

from llm_astar_lab.analysis.summary import RunSummary, VariantSummary, is_baseline
from llm_astar_lab.pictures import style
from llm_astar_lab.report import sentences
from llm_astar_lab.report.sentences import has_waypoints, headline, provenance, variant_label
from llm_astar_lab.report.table import markdown, text, texts_of
from llm_astar_lab.report.tables import main_table, report_tables, terminal_table

# The lines of a README between which `replace_section` writes.
SECTION_BEGIN, SECTION_END = '<!-- results:begin -->', '<!-- results:end -->'
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
NO_SAMPLES = MappingProxyType({'maps': {}, 'cases': [], 'samples': [], 'strings': [], 'total': 0})
# File names or contents with their captions.
Pictures = Sequence[tuple[Path, str]]
TEMPLATES = Environment(
    loader=PackageLoader('llm_astar_lab', 'report'), autoescape=select_autoescape(['html.j2'])
)


def markdown_page(template: str, **values: object) -> str:
    """Return a page in Markdown of a template; parts of it that are empty leave no space."""
    page: str = TEMPLATES.get_template(template).render(values)
    return re.sub(r'\n{3,}', '\n\n', page).strip() + '\n'


def bullets(lines: Iterable[str]) -> str:
    """Return lines as a Markdown list."""
    return '\n'.join(f'- {line}' for line in lines)


def said_of(run: RunSummary) -> dict[str, Any]:
    """Return what a report says in texts and tables."""
    metadata, bags = run.metadata, run.metadata.get('bags')
    return {
        'title': f'Evaluation of bags: {", ".join(bags)}' if bags else 'Benchmark report',
        'headline': headline(run.comparisons),
        'recorded': sentences.recorded_sentence(run.recorded),
        'provenance': provenance(run),
        'tables': report_tables(run),
        'sentences': [sentences.sentence(item) for item in run.comparisons if item.samples],
        'grown': sentences.growth_sentence(run.growths) or '',
        'left_out': list(metadata.get('left_out') or []),
        'notes': list(metadata.get('notes') or []),
    }


def markdown_report(run: RunSummary, pictures: Pictures = ()) -> str:
    """Return the report with links to pictures in the same folder, but for a page's panels."""
    shown = [(path.name, caption) for path, caption in pictures if not is_panel(path)]
    return markdown_page('report.md.j2', **said_of(run), pictures=shown)


def html_report(
    run: RunSummary,
    pictures: Pictures = (),
    samples: Mapping[str, Any] = NO_SAMPLES,
    *,
    has_zone: bool = False,
) -> str:
    """Return the page, which loads nothing from the network.

    `samples` is what its browser of samples shows; `has_zone` says that the robot's body closes
    cells.
    """
    bars, mark = work_bars(run.variants)
    page: str = TEMPLATES.get_template('report.html.j2').render(
        **said_of(run), **page_pictures(pictures), bars=bars,
        mark_100=mark, zone=[(style.INFLATED, 'inflated zone')] if has_zone else [],
        data=script_json(samples), colours=script_json(style.page_colours()),
    )  # fmt: skip
    return page


TEMPLATES.globals.update(markdown=markdown, bullets=bullets, texts_of=texts_of, style=style)


def is_panel(path: Path) -> bool:
    """Tell whether a picture is of a single method, for the page alone."""
    return path.name.startswith(PANEL)


def page_pictures(pictures: Pictures) -> dict[str, Any]:
    """Return the pictures that the page shows: the panels of one sample, and others."""
    data = {path: data_url(path.read_bytes(), f'image/{path.suffix[1:]}') for path, _ in pictures}
    return {
        'panels': [(data[path], caption) for path, caption in pictures if is_panel(path)],
        'pictures': [
            (data[path], caption, PICTURE_TITLES.get(path.stem, caption))
            for path, caption in pictures
            if path.stem not in ('compare', 'ratios') and not is_panel(path)
        ],
        'where': next((caption for path, caption in pictures if path.stem == 'compare'), ''),
    }


def work_bars(summaries: Sequence[VariantSummary]) -> tuple[list[dict[str, Any]], float]:
    """Return the bars of the expansions against A*, and where 100 % is on their scale.

    `ends` are the mean and its interval in percent of the longest bar.
    """
    shown = [item for item in summaries if item.operation.mean.value > 0]
    if len(shown) > MAX_BARS:
        shown = [item for item in shown if is_shown(item)]
    known = (end for item in shown for end in item.operation.mean if not math.isnan(end))
    longest = max([1.0, *known])
    bars = []
    for item in shown:
        work, length = item.operation.mean, item.length.mean
        ends = (work.value if math.isnan(end) else end for end in work)
        bars.append({
            'label': variant_label(item.variant),
            'work': f'{100 * work.value:.1f} %',
            'length': f'{100 * (length.value - 1):+.2f} %',
            'ends': [min(100.0, 100 * end / longest) for end in ends],
            'has_waypoints': has_waypoints(item.variant),
        })  # fmt: skip
    return bars, 100.0 / longest


def is_shown(summary: VariantSummary) -> bool:
    """Tell whether a variant is in the first figure where there are many."""
    source = summary.variant.source
    return source in SHOWN_SOURCES or not (is_baseline(summary.variant) or '-best-' in source)


def data_url(content: bytes, media_type: str) -> str:
    """Return content as a URL that holds it."""
    return f'data:{media_type};base64,{base64.b64encode(content).decode()}'


def script_json(values: Mapping[str, Any]) -> Markup:
    """Return JSON that cannot close the enclosing script element, whatever a model wrote."""
    written = json.dumps(dict(values), separators=(',', ':'), allow_nan=False)
    return Markup(written.replace('<', '\\u003c'))  # noqa: S704 - it holds no <


def results_section(run: RunSummary) -> str:
    """Return the part of a report for a README: finding, table, provenance."""
    table = markdown(main_table(run.variants))
    return '\n\n'.join([headline(run.comparisons), table, provenance(run)])


def text_report(run: RunSummary) -> str:
    """Return the finding and the table for a terminal; for bags also the recorded lengths."""
    said = [sentences.recorded_sentence(run.recorded), headline(run.comparisons)]
    return '\n'.join([text(terminal_table(run.variants)), '', *filter(None, said)])


def replace_section(path: Path, section: str) -> None:
    """Put `section` between the marker lines of a text file and leave the rest unchanged.

    Raises ValueError where the markers are missing or out of order, OSError where the file is.
    """
    head, begin, rest = path.read_text(encoding='utf-8').partition(SECTION_BEGIN)
    _, end, tail = rest.partition(SECTION_END)
    if not (begin and end):
        lines = f'{SECTION_BEGIN} and {SECTION_END}'
        raise ValueError(f'{path}: the lines {lines} are missing or out of order')
    path.write_text(f'{head}{begin}\n{section.strip()}\n{end}{tail}', encoding='utf-8')
