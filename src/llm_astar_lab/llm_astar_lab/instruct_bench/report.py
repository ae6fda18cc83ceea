"""Results of a run over a suite as tables, CSV rows, Markdown, and one instruction in full."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from llm_astar_planner.instructions.sentence import canonical_sentence

from llm_astar_lab.instruct_bench.results import InstructionResult
from llm_astar_lab.instruct_bench.suite import OK
from llm_astar_lab.instruct_bench.summary import Share, SuiteSummary, by_source, grouped, summarise
from llm_astar_lab.report.table import TextRows, markdown_table, text_table

SHARE_HEAD = (
    'Instructions', 'Understood exactly', 'Satisfied if meetable', 'so without instruction',
    'False claims', 'Recognised if not meetable',
)  # fmt: skip
MAIN_HEAD = ('Source', *SHARE_HEAD)
DETAIL_HEAD = (
    'Source', 'Falsely satisfied clauses', 'Satisfied, not asked', 'Said not understood',
    'Said violated', 'Unanswered',
    'Understanding ms', 'longest', 'Planning ms', 'Tokens in', 'Tokens out',
)  # fmt: skip
# The groups that have tables, with the heading of their first column.
TABLES = {
    'style': 'Style',
    'language': 'Language',
    'clause': 'With a clause',
    'clauses': 'Number of clauses',
    'expected': 'Expected',
    'writer': 'Writer',
    'map': 'Map',
}
TERMINAL_TABLES = ('style', 'language', 'clause', 'clauses', 'expected')
EXPLANATION = (
    'In percent with 95 % intervals (Wilson), and counts. *Satisfied*: the path fulfils all '
    'checks of the suite; *so without instruction*: the path planned without it does. A *false '
    'claim* reports an instruction as satisfied whose path fails a check, or that cannot be met '
    'or asks nothing. *Not meetable* are impossible, contradictory and irrelevant instructions; '
    'they are *recognised* where the report says so or says that they were not understood. '
    'Milliseconds are medians.'
)


def text_summary(results: Sequence[InstructionResult]) -> str:
    """Return the tables for a terminal."""
    sources = by_source(results)
    tables = [text_table(MAIN_HEAD, main_table(sources))]
    tables.append(text_table(DETAIL_HEAD, detail_table(sources)))
    for group in TERMINAL_TABLES:
        rows = group_table(sources, group)
        if len({row[1] for row in rows}) > 1:
            tables.append(text_table(group_head(group), rows))
    return '\n\n'.join(tables)


def markdown_summary(results: Sequence[InstructionResult], metadata: Mapping[str, Any]) -> str:
    """Return the report: tables, false claims, what was not met, provenance."""
    sources = by_source(results)
    parts = [
        f'# Instructions: {metadata["dataset"]["file"]}',
        EXPLANATION,
        markdown_table(MAIN_HEAD, main_table(sources)),
        markdown_table(DETAIL_HEAD, detail_table(sources)),
    ]
    for group, title in TABLES.items():
        parts += [f'## {title}', markdown_table(group_head(group), group_table(sources, group))]
    for source, own in sources.items():
        parts += [
            f'## {source}: false claims, whole or of a clause',
            bullets([r for r in own if r.false_claim or r.false_clauses]),
            f'## {source}: clauses reported as satisfied that were not asked',
            bullets([r for r in own if r.unasked_clauses]),
            f'## {source}: not satisfied, of those that can be',
            bullets([r for r in own if r.instruction.expect == OK and not r.fulfilled]),
        ]
    machine = metadata['machine']
    parts.append(
        f'llm_astar_planner {metadata["version"]}, suite sha256 '
        f'{metadata["dataset"]["sha256"][:12]}, {machine["cores"]} cores of '
        f'{machine["processor"]}, Python {machine["python"]}.'
    )
    return '\n\n'.join(part for part in parts if part) + '\n'


def main_table(sources: Mapping[str, Sequence[InstructionResult]]) -> TextRows:
    """Return a row of shares a source."""
    return [(name, *share_cells(summarise(own))) for name, own in sources.items()]


def detail_table(sources: Mapping[str, Sequence[InstructionResult]]) -> TextRows:
    """Return a row of the other figures a source."""
    return [(name, *detail_cells(summarise(own))) for name, own in sources.items()]


def group_head(group: str) -> tuple[str, ...]:
    """Return the header of the table of a group."""
    return ('Source', TABLES[group], *SHARE_HEAD)


def group_table(sources: Mapping[str, Sequence[InstructionResult]], group: str) -> TextRows:
    """Return a row of shares for each source and name of a group."""
    return [
        (source, name, *share_cells(summarise(part)))
        for source, own in sources.items()
        for name, part in grouped(own, group).items()
    ]


def share_cells(summary: SuiteSummary) -> tuple[str, ...]:
    """Return the cells of SHARE_HEAD."""
    shares = (
        summary.exact, summary.satisfied, summary.already, summary.false_claims,
        summary.recognised,
    )  # fmt: skip
    return str(summary.instructions), *map(share_text, shares)


def detail_cells(summary: SuiteSummary) -> tuple[str, ...]:
    """Return the cells of DETAIL_HEAD without the source."""
    seconds = (summary.seconds, summary.longest, summary.planning_seconds)
    return (
        share_text(summary.false_clauses),
        share_text(summary.unasked_clauses),
        share_text(summary.said_not_understood),
        share_text(summary.said_violated),
        str(summary.unanswered.count),
        *(f'{1000.0 * value:.2f}' for value in seconds),
        str(summary.prompt_tokens),
        str(summary.output_tokens),
    )


def share_text(share: Share) -> str:
    """Write a share as `92.9 (83.0-97.2) 54/58`."""
    if not share.total:
        return '-'
    value, low, high = (100.0 * end for end in share.interval)
    return f'{value:.1f} ({low:.1f}-{high:.1f}) {share.count}/{share.total}'


def bullets(results: Sequence[InstructionResult]) -> str:
    """Return a line for each result: id, text, what was understood, which checks failed."""
    if not results:
        return 'None.'
    return '\n'.join(
        f'- `{result.instruction.id}` "{one_line(result.instruction.text)}": '
        f'{understood_sentence(result) or "nothing"}; {failed_checks(result)}'
        for result in results
    )


def one_line(text: str) -> str:
    """Return the beginning of a text as one line without Markdown."""
    return ' '.join(text.split())[:200].replace('`', "'").replace('|', '/')


def understood_sentence(result: InstructionResult) -> str:
    """Return the canonical sentence of what was understood, '' of nothing."""
    return '' if result.outcome is None else result.outcome.interpretation.sentence


def unanswered_lines(results: Sequence[InstructionResult]) -> list[str]:
    """Return a line for each source that left instructions unanswered."""
    lines = []
    for source, own in by_source(results).items():
        missing = [result for result in own if result.unanswered and result.outcome]
        if missing:
            first = missing[0]
            detail = first.outcome.interpretation.detail if first.outcome else ''
            lines.append(
                f'{source}: {len(missing)} instructions without an answer, the first '
                f'{first.instruction.id}: {detail}'
            )
    return lines


def failed_checks(result: InstructionResult) -> str:
    """Name the checks that failed, with what was measured."""
    if result.plan.code != 0:
        return f'no path: {result.plan.message}'
    failed = [
        f'{check.kind}: {verdict.detail}'
        for check, verdict in zip(result.instruction.checks, result.verdicts)
        if not verdict.holds
    ]
    return '; '.join(failed) or 'all checks hold'


def result_row(result: InstructionResult) -> dict[str, Any]:
    """Return a result as a row of results.csv."""
    instruction, outcome = result.instruction, result.outcome
    interpretation = outcome.interpretation if outcome else None
    return {
        'id': instruction.id,
        'source': result.source,
        'map': instruction.suite_map.name,
        'lang': instruction.lang,
        'style': instruction.style,
        'writer': instruction.writer,
        'tags': ' '.join(instruction.tags),
        'clauses': ' '.join(clause.kind for clause in instruction.truth.clauses),
        'expect': instruction.expect,
        'text': instruction.text,
        'status': interpretation.status.value if interpretation else '',
        'understood_by': interpretation.understood_by if interpretation else '',
        'understood': understood_sentence(result),
        'exact': int(result.exact),
        'claimed': int(result.claimed),
        'fulfilled': int(result.fulfilled),
        'already': int(result.already),
        'false_claim': int(result.false_claim),
        'claimed_clauses': len(result.claimed_clauses),
        'false_clauses': len(result.false_clauses),
        'unasked_clauses': len(result.unasked_clauses),
        'recognition': result.recognition,
        'checks': '; '.join(check_lines(result)),
        'report': outcome.summary() if outcome else '',
        'code': result.plan.code.name,
        'length': round(path_length(result), 6),
        'direct_length': round(result.direct_length, 6),
        'seconds': round(result.seconds, 6),
        'planning_seconds': round(result.planning_seconds, 6),
        'prompt_tokens': interpretation.prompt_tokens if interpretation else 0,
        'output_tokens': interpretation.output_tokens if interpretation else 0,
    }


def path_length(result: InstructionResult) -> float:
    """Return the length of the plan's path in metres, NaN without one."""
    return result.plan.length * result.instruction.suite_map.grid_map.resolution


def check_lines(result: InstructionResult) -> list[str]:
    """Return a line for each check: its kind, whether it holds, what was measured."""
    return [
        f'{check.kind} {"holds" if verdict.holds else "fails"} ({verdict.detail})'
        for check, verdict in zip(result.instruction.checks, result.verdicts)
    ]


def chain_text(result: InstructionResult) -> str:
    """Return one instruction in full: text, what was understood, clauses, checks, path."""
    instruction, outcome = result.instruction, result.outcome
    lines = [
        f'{instruction.id}: map {instruction.suite_map.name}, {instruction.lang}, expected '
        f'{instruction.expect}; source {result.source}',
        f'text        {" ".join(instruction.text.split())}',
        f'truth       {canonical_sentence(instruction.truth) or "nothing asked"}',
    ]
    if outcome is not None:
        lines += outcome_lines(result)
    lines += [f'check       {line}' for line in check_lines(result)]
    if result.plan.code != 0:
        lines.append(f'no path     {result.plan.message}')
    lines.append(
        f'path        {path_length(result):.2f} m, {result.direct_length:.2f} m without '
        f'instruction, planned in {1000.0 * result.planning_seconds:.1f} ms'
    )
    return '\n'.join(lines)


def outcome_lines(result: InstructionResult) -> list[str]:
    """Return the lines on what was understood and what is reported."""
    if result.outcome is None:
        return []
    interpretation = result.outcome.interpretation
    by = f' by {interpretation.understood_by}' if interpretation.understood_by else ''
    exact = ', exactly' if result.exact else ''
    lines = [
        f'understood  {interpretation.sentence or "-"}',
        f'            {interpretation.status.value}{by}{exact}, in '
        f'{1000.0 * result.seconds:.2f} ms',
    ]
    if interpretation.detail:
        lines.append(f'            {interpretation.detail}')
    for clause in result.outcome.to_json()['clauses']:
        detail = f' ({clause["detail"]})' if clause['detail'] else ''
        lines.append(f'clause      {clause["clause"]}: {clause["status"]}{detail}')
    if result.outcome.note:
        lines.append(f'note        {result.outcome.note}')
    claim = 'satisfied' if result.claimed else 'not satisfied'
    wrong = ', which is false' if result.false_claim else ''
    return [*lines, f'reported    {claim}{wrong}']
