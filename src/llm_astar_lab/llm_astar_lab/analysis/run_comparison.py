"""Compares results folders of one dataset: which runs they are, and how their variants differ."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

from llm_astar_msgs_adapter.errors import shortened
from llm_astar_planner.parameter import nearest_name

from llm_astar_lab.analysis.paired import (
    SampleChange,
    VariantChange,
    pair_rows,
    sample_changes,
    variant_change,
)
from llm_astar_lab.analysis.summary import report_order
from llm_astar_lab.analysis.thresholds import variants_of
from llm_astar_lab.results.folder import ResultsFolder
from llm_astar_lab.results.row import ResultsError, Variant
from llm_astar_lab.results.stored_rows import StoredRows

# Changed samples that are kept of each variant, the largest changes first.
MAX_SAMPLES = 10_000
# Parameters of a run that do not change its rows.
IRRELEVANT = ('jobs', 'price')


class Run(NamedTuple):
    """A results folder that was read: its path, metadata and rows."""

    path: Path
    metadata: Mapping[str, Any]
    rows: StoredRows


@dataclass(frozen=True)
class RunComparison:
    """A run compared with the base: what differs in how they were run, and in their results.

    `unpaired` are the variants that only one of them has or that share no sample, `missing` those
    of them that the base has.
    """

    path: Path
    differences: Sequence[str]
    changes: Sequence[VariantChange]
    unpaired: Sequence[Variant]
    missing: Sequence[Variant]
    samples: Sequence[SampleChange]


def load_run(path: str, base: Run | None = None) -> Run:
    """Read a results folder, to be compared with a base if that is given.

    Raises ResultsError where it is none or has no rows.
    """
    folder = ResultsFolder(path)
    metadata = folder.read_metadata()
    rows = folder.stored(None if base is None else base.rows)
    if not len(rows):
        raise ResultsError(f'{folder.results}: has no rows; run the benchmark to its end first')
    return Run(folder.path, metadata, rows)


def compare_runs(base: Run, other: Run, metric: str, name: str | None = None) -> RunComparison:
    """Compare a run with the base, all variants or those called `name`, largest changes by metric.

    Raises ResultsError where they have different datasets or share no samples.
    """
    check_datasets(base, other)
    seed = int(base.metadata['parameters'].get('seed', 0))
    of_base = base.rows.variants()
    every = sorted({*of_base, *other.rows.variants()}, key=report_order)
    chosen = chosen_variants(every, name)
    changes, samples = [], []
    for variant in chosen:
        paired = pair_rows(base.rows, other.rows, variant)
        if paired is not None:
            changes.append(variant_change(paired, seed))
            samples += sample_changes(paired, metric, MAX_SAMPLES)
    if not changes:
        message = f'{base.path} and {other.path} share no sample of {name or "any variant"}'
        raise ResultsError(message)
    compared = {change.variant for change in changes}
    return RunComparison(
        other.path,
        list(differences(base.metadata, other.metadata)),
        changes,
        [variant for variant in chosen if variant not in compared],
        [variant for variant in of_base if variant in chosen and variant not in compared],
        sorted(samples, key=lambda sample: -sample.size),
    )


def chosen_variants(every: Sequence[Variant], name: str | None) -> list[Variant]:
    """Return the variants that a name or its beginning means. Raises ResultsError for none."""
    names = [str(variant) for variant in every]
    found = variants_of(name or '', names)
    if not found:
        near = nearest_name(name or '', names)
        message = f'--variant {name}: no such variant{near or ";"} there are {", ".join(names)}'
        raise ResultsError(message)
    return [variant for variant in every if str(variant) in found]


def check_datasets(base: Run, other: Run) -> None:
    """Raise ResultsError where two runs are of different datasets or grids."""
    facts = [
        (run.metadata['dataset'].get('sha256'), run.metadata['parameters'].get('grid'))
        for run in (base, other)
    ]
    if facts[0] != facts[1]:
        first, second = (describe_dataset(run.metadata) for run in (base, other))
        message = (
            f'{base.path} and {other.path} cannot be compared: the first is of {first}, '
            f'the second of {second}'
        )
        raise ResultsError(message)


def describe_dataset(metadata: Mapping[str, Any]) -> str:
    """Return the name of a run's dataset with the beginning of its digest, and of its grid's."""
    dataset, grid = metadata['dataset'], metadata['parameters'].get('grid')
    text = f'{shortened(dataset.get("file", "?"))} (sha256 {str(dataset.get("sha256", "?"))[:12]}'
    return f'{text}, grid {str(grid)[:12]})' if grid else f'{text})'


def differences(before: Mapping[str, Any], now: Mapping[str, Any]) -> Iterator[str]:
    """Yield what differs in how two runs were made: version, parameters, inputs, machine."""
    if before['version'] != now['version']:
        yield f'version: {before["version"]}, now {now["version"]}'
    for part in ('parameters', 'files', 'packages', 'machine'):
        first, second = before.get(part) or {}, now.get(part) or {}
        for name in dict.fromkeys((*first, *second)):
            values = first.get(name), second.get(name)
            if name not in IRRELEVANT and values[0] != values[1]:
                old, new = ('none' if value is None else shortened(str(value)) for value in values)
                if part == 'files':
                    old, new = old[:12], new[:12]
                yield f'{part}: {name}: {old}, now {new}'
