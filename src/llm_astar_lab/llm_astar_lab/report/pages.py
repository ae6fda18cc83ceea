# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""What is read of a results folder: summary.json, the report as Markdown and as one HTML page.

And its text for a terminal, and the section of a README.
"""

import json
import math
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from types import MappingProxyType
from typing import Any

from llm_astar_msgs_adapter.errors import LlmAstarError, printable, shortened
from llm_astar_msgs_adapter.maps.problem_maps import ProblemMap
from llm_astar_planner.costmap.config import CostmapConfig
from markupsafe import Markup

from llm_astar_lab.analysis.replies import reply_shares
from llm_astar_lab.analysis.summary import RunSummary, VariantSummary, summarise_run
from llm_astar_lab.pictures import style
from llm_astar_lab.report import sentences
from llm_astar_lab.report import table as tables
from llm_astar_lab.report.samples import browser_data, shown_samples
from llm_astar_lab.report.sentences import headline, provenance
from llm_astar_lab.results.folder import ResultsFolder
from llm_astar_lab.results.row import ResultsError
from llm_astar_lab.results.stored_rows import StoredRows
from llm_astar_lab.templates import render

# The lines of a README between which `replace_section` writes.
SECTION_BEGIN, SECTION_END = '<!-- results:begin -->', '<!-- results:end -->'
# Variants in the first figure, and the sources that it shows where there are more.
MAX_BARS = 12
SHOWN_SOURCES = ('none', 'oracle', 'random')
NO_SAMPLES = MappingProxyType({'maps': {}, 'cases': [], 'samples': [], 'strings': [], 'total': 0})
# Figures that are lists in summary.json, and those of runs with instructions.
LISTS, INSTRUCTED = ('proven', 'operation_exact'), ('instruction', 'recorded_instruction')


def markdown_page(template: str, **values: object) -> str:
    """Return a page in Markdown of a template; parts of it that are empty leave no space."""
    page = render(template, **values, markdown=tables.markdown, bullets=bullets)
    return re.sub(r'\n{3,}', '\n\n', page).strip() + '\n'


def bullets(lines: Iterable[str]) -> str:
    """Return lines as a Markdown list."""
    return '\n'.join(f'- {printable(line)}' for line in lines)


def said_of(run: RunSummary) -> dict[str, Any]:
    """Return what a report says in texts and tables."""
    metadata, bags = run.metadata, run.metadata.get('bags')
    return {
        'title': f'Evaluation of bags: {", ".join(bags)}' if bags else 'Benchmark report',
        'headline': headline(run.comparisons), 'recorded': sentences.say('recorded', run.recorded),
        'provenance': provenance(run), 'tables': tables.report_tables(run),
        'sentences': [sentences.sentence(item) for item in run.comparisons if item.samples],
        'grown': sentences.growth_sentence(run.growths),
        'left_out': metadata.get('left_out') or [], 'notes': metadata.get('notes') or [],
    }  # fmt: skip


def html_report(run: RunSummary, samples: Mapping[str, Any] = NO_SAMPLES) -> str:
    """Return the page, which loads nothing from the network.

    `samples` is what its browser of samples shows.
    """
    bars = shown_bars(run.variants)
    known = (end for item in bars for end in item.operation.mean if not math.isnan(end))
    return render(
        'report/report.html.j2', **said_of(run), bars=bars, longest=max([1.0, *known]),
        data=script_json(samples), colours=script_json(style.page_colours()),
        style=style, texts_of=tables.texts_of, label=sentences.variant_label,
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


def script_json(values: Mapping[str, Any]) -> Markup:
    """Return JSON that cannot close the enclosing script element, whatever a model wrote."""
    written = json.dumps(dict(values), separators=(',', ':'), allow_nan=False)
    return Markup(written.replace('<', '\\u003c'))  # noqa: S704 - it holds no <


def results_section(run: RunSummary) -> str:
    """Return the part of a report for a README: finding, table, provenance."""
    table = tables.markdown(tables.Table.of('main', run.variants))
    return '\n\n'.join([headline(run.comparisons), table, provenance(run)])


def text_report(run: RunSummary) -> str:
    """Return the finding and the table for a terminal; for bags also the recorded lengths."""
    said = [sentences.say('recorded', run.recorded), headline(run.comparisons)]
    table = tables.text_table(*tables.texts_of(tables.Table.of('terminal', run.variants)))
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


def write_report(
    folder: ResultsFolder,
    metadata: Mapping[str, Any],
    maps: Sequence[ProblemMap],
    rows: StoredRows | None = None,
) -> RunSummary:
    """Write summary.json, report.md and report.html; return what they are made of.

    `maps` are the unscaled maps of the rows, with their samples; `rows` are those of the folder
    where they have been read. Raises ResultsError.
    """
    rows = folder.stored() if rows is None else rows
    shown = shown_samples(rows, maps)
    run = summarise_run(rows, metadata)
    summary = {
        'headline': headline(run.comparisons),
        'sentences': [sentences.sentence(item) for item in run.comparisons if item.samples],
        'rows': len(rows),
        'cases': [to_json(item) for item in run.variants],
        'over_none': [to_json(item) for item in run.comparisons],
        'growth': [to_json(item) for item in run.growths],
        **{name: metadata[name] for name in ('version', 'dataset', 'machine')},
        **{name: metadata[name] for name in ('left_out', 'notes', 'replays') if name in metadata},
    }
    folder.write_json('summary.json', summary)
    folder.write_text('report.md', markdown_page('report/report.md.j2', **said_of(run)))
    samples = browser_data(shown, maps, costmap_of(metadata), folder.read_places())
    folder.write_text('report.html', html_report(run, samples))
    return run


def to_json(item: Any) -> dict[str, Any]:  # noqa: ANN401 - a summary, comparison or growth
    """Return the figures of a variant by name, without those of what the run did not have.

    The keys of the file are older than the word variant: `case` is its name.
    """
    values = asdict(item)
    if isinstance(item, VariantSummary):
        # Older than the intervals and objects, and read by scripts: a number, and lists.
        older = {'optimal': item.optimal.value} | {name: values[name] for name in LISTS}
        values = tables.json_of(item) | older | {'optimal_share': tables.json_of(item.optimal)}
        if item.replies:
            values['reply_shares'] = tables.json_of(reply_shares(item.replies))
        absent = [name for name in INSTRUCTED if math.isnan(getattr(item, name).value)]
        absent += () if item.families else ('families', 'family_means')
        absent += () if item.replies else ('replies', 'seconds_reply')
        values = {name: value for name, value in values.items() if name not in absent}
    del values['variant']
    return {'case': str(item.variant), **values, **item.variant._asdict()}


def costmap_of(metadata: Mapping[str, Any]) -> CostmapConfig | None:
    """Return the costmap rules of a run, None where it had none. Raises ResultsError."""
    rules = metadata['parameters'].get('rules')
    try:
        return None if rules is None else CostmapConfig(**rules)
    except (TypeError, LlmAstarError) as error:
        raise ResultsError(f'metadata.json: parameters: rules: {shortened(str(error))}') from None
