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

from llm_astar_msgs_adapter.errors import printable
from markupsafe import Markup

from llm_astar_lab.analysis.summary import RunSummary, VariantSummary
from llm_astar_lab.pictures import style
from llm_astar_lab.report import sentences
from llm_astar_lab.report.sentences import headline, provenance
from llm_astar_lab.report.table import (
    Table,
    main_table,
    markdown,
    report_tables,
    text_table,
    texts_of,
)
from llm_astar_lab.templates import render

# The lines of a README between which `replace_section` writes.
SECTION_BEGIN, SECTION_END = '<!-- results:begin -->', '<!-- results:end -->'
# Variants in the first figure, and the sources that it shows where there are more.
MAX_BARS = 12
SHOWN_SOURCES = ('none', 'oracle', 'random')
NO_SAMPLES = MappingProxyType({'maps': {}, 'cases': [], 'samples': [], 'strings': [], 'total': 0})
# File names or contents with their captions.
Pictures = Sequence[tuple[Path, str]]


def markdown_page(template: str, **values: object) -> str:
    """Return a page in Markdown of a template; parts of it that are empty leave no space."""
    page = render(template, **values, markdown=markdown, bullets=bullets)
    return re.sub(r'\n{3,}', '\n\n', page).strip() + '\n'


def bullets(lines: Iterable[str]) -> str:
    """Return lines as a Markdown list."""
    return '\n'.join(f'- {printable(line)}' for line in lines)


def said_of(run: RunSummary, pictures: Pictures) -> dict[str, Any]:
    """Return what a report says in texts, tables and pictures."""
    metadata, bags = run.metadata, run.metadata.get('bags')
    return {
        'title': f'Evaluation of bags: {", ".join(bags)}' if bags else 'Benchmark report',
        'headline': headline(run.comparisons), 'recorded': sentences.say('recorded', run.recorded),
        'provenance': provenance(run), 'tables': report_tables(run),
        'sentences': [sentences.sentence(item) for item in run.comparisons if item.samples],
        'grown': sentences.growth_sentence(run.growths),
        'left_out': metadata.get('left_out') or [], 'notes': metadata.get('notes') or [],
        'pictures': pictures,
    }  # fmt: skip


def markdown_report(run: RunSummary, pictures: Pictures = ()) -> str:
    """Return the report with links to pictures in the same folder, but for a page's panels."""
    return markdown_page('report/report.md.j2', **said_of(run, pictures))


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
    bars = shown_bars(run.variants)
    known = (end for item in bars for end in item.operation.mean if not math.isnan(end))
    return render(
        'report/report.html.j2', **said_of(run, pictures), bars=bars, longest=max([1.0, *known]),
        has_zone=has_zone, data=script_json(samples), colours=script_json(style.page_colours()),
        style=style, texts_of=texts_of, picture_url=picture_url, label=sentences.variant_label,
        has_waypoints=sentences.has_waypoints,
    )  # fmt: skip


def shown_bars(summaries: Sequence[VariantSummary]) -> list[VariantSummary]:
    """Return the variants of the first figure: where there are many, only some sources."""
    shown = [item for item in summaries if item.operation.mean.value > 0]
    return [
        item
        for item in shown
        if len(shown) <= MAX_BARS
        or item.variant.source in SHOWN_SOURCES
        or not (item.variant.is_baseline or '-best-' in item.variant.source)
    ]


def picture_url(path: Path) -> str:
    """Return a picture as a URL that holds it."""
    return data_url(path.read_bytes(), f'image/{path.suffix[1:]}')


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
    said = [sentences.say('recorded', run.recorded), headline(run.comparisons)]
    table = text_table(*texts_of(Table.of('terminal', run.variants)))
    return '\n'.join([table, '', *filter(None, said)])


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
