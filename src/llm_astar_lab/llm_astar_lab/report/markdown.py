"""The report as Markdown and as text: the finding, the paper's table, spreads, provenance."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from llm_astar_lab.analysis.summary import RunSummary, compare_with_none, summarise
from llm_astar_lab.report.formats import markdown, text
from llm_astar_lab.report.sentences import (
    counted,
    growth_sentence,
    headline,
    sentence,
)
from llm_astar_lab.report.tables import (
    INSTRUCTION_COLUMNS,
    RECORDED_COLUMN,
    main_table,
    mean_of,
    report_tables,
)
from llm_astar_lab.results.stored_rows import StoredRows

# The lines of a README between which `replace_section` writes.
SECTION_BEGIN, SECTION_END = '<!-- results:begin -->', '<!-- results:end -->'


def markdown_report(
    run: RunSummary, *, recorded: str | None = None, pictures: Sequence[tuple[str, str]] = ()
) -> str:
    """Return the report; `pictures` are (file name, caption) in the same folder.

    `recorded` is the sentence about the plans in the bags.
    """
    remarks = {
        'over_none': '\n'.join(f'- {sentence(item)}' for item in run.comparisons if item.samples),
        'growth': growth_sentence(run.growths) or '',
    }
    parts = [
        f'# {report_title(run.metadata)}',
        headline(run.comparisons),
        recorded or '',
        provenance(run),
    ]
    for table in report_tables(run):
        parts += [f'## {table.title}', table.note, markdown(table), remarks.get(table.name, '')]
    for title, name in (('## Left out', 'left_out'), ('## Notes on the input', 'notes')):
        if lines := run.metadata.get(name):
            parts += [title, '\n'.join(f'- {line}' for line in lines)]
    parts += [f'![{caption}]({file})\n\n{caption}' for file, caption in pictures]
    return '\n\n'.join(part for part in parts if part) + '\n'


def report_title(metadata: Mapping[str, Any]) -> str:
    """Return the title of a report on samples, or on bags by their names."""
    bags = metadata.get('bags')
    return f'Evaluation of bags: {", ".join(bags)}' if bags else 'Benchmark report'


def results_section(run: RunSummary) -> str:
    """Return the part of a report for a README: finding, table, provenance."""
    table = markdown(main_table(run.variants))
    return '\n\n'.join([headline(run.comparisons), table, provenance(run)])


def provenance(run: RunSummary) -> str:
    """Say which samples, settings, version and machine the figures come from."""
    metadata = run.metadata
    dataset, machine = metadata.get('dataset', {}), metadata.get('machine', {})
    parameters = metadata.get('parameters', {})
    most = max(run.variants, key=lambda summary: summary.samples, default=None)
    size = ''
    if most is not None:
        size = f'{counted(most.samples, "sample")} of {counted(most.maps, "map")} from '
    heuristic = parameters.get('heuristic')
    sha = f' (sha256 {str(dataset["sha256"])[:12]})' if dataset.get('sha256') else ''
    facts = [
        f'{size}`{dataset["file"]}`{sha}' if 'file' in dataset else size.removesuffix(' from '),
        f'seed {parameters["seed"]}' if 'seed' in parameters else '',
        f'heuristic {heuristic}' if heuristic else '',
        f'llm_astar_planner {metadata["version"]}' if 'version' in metadata else '',
    ]
    text = ', '.join(fact for fact in facts if fact)
    if machine:
        text += (
            f'; run in {float(metadata.get("seconds") or 0.0):.1f} s with '
            f'{parameters.get("jobs", 1)} at once on {machine.get("cores")} cores of '
            f'{machine.get("processor")}, Python {machine.get("python")}'
        )
    return f'{text}.' if text else ''


def text_report(rows: StoredRows, seed: int = 0, recorded: str | None = None) -> str:
    """Return the finding and the table for a terminal; for bags also the recorded lengths.

    `recorded` is the sentence about the plans in the bags.
    """
    summaries = summarise(rows, seed)
    table = main_table(summaries)
    table = table.with_column(RECORDED_COLUMN, [mean_of(item.recorded) for item in summaries])
    for column, name in zip(INSTRUCTION_COLUMNS, ('instruction', 'recorded_instruction')):
        table = table.with_column(column, [getattr(item, name) for item in summaries])
    sentences = [recorded, headline(compare_with_none(rows, seed))]
    return '\n'.join([text(table), '', *filter(None, sentences)])


def replace_section(path: Path, section: str) -> None:
    """Put `section` between the marker lines of a text file and leave the rest unchanged.

    Raises ValueError where the markers are missing or out of order, OSError where the file is.
    """
    text = path.read_text(encoding='utf-8')
    head, begin, rest = text.partition(SECTION_BEGIN)
    _, end, tail = rest.partition(SECTION_END)
    if not (begin and end):
        lines = f'{SECTION_BEGIN} and {SECTION_END}'
        raise ValueError(f'{path}: the lines {lines} are missing or out of order')
    path.write_text(
        f'{head}{SECTION_BEGIN}\n{section.strip()}\n{SECTION_END}{tail}', encoding='utf-8'
    )
