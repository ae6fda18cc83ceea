# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""What one run covers, and how it is started, resumed, shown and written to its folder."""

import sys
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass
from itertools import count
from typing import Any

from llm_astar_planner.cli.flags import option
from tqdm import tqdm

from llm_astar_lab.datasets.named import BenchmarkSample, sample_pairs
from llm_astar_lab.results.folder import ResultsFolder, run_differences
from llm_astar_lab.results.row import ResultsError, Row
from llm_astar_lab.results.stored_rows import UNANSWERED, Finished, StoredRows
from llm_astar_lab.runner import engine
from llm_astar_lab.runner.engine import Task
from llm_astar_lab.runner.sources import Coverage, SourceSpec

# How rows are stored; a run of at least so many is large.
FORMATS = CSV, PARQUET = 'csv', 'parquet'
LARGE_RUN = 200_000
# What the report says of a file that changed before a run was resumed.
ANOTHER_INPUT = ': was another file when earlier rows were made'
# Steps between two lines where the total is unknown.
UNKNOWN_STRIDE = 100


@dataclass(frozen=True)
class BenchmarkConfig:
    """What a run covers.

    Scale 1 runs all `samples`. To compare scales, `scale_samples` drawn samples are run at every
    scale, 1 included. `coverage` says which samples replays lack.
    """

    samples: Sequence[BenchmarkSample]
    methods: Sequence[str]
    sources: Sequence[SourceSpec]
    settings: engine.SearchSettings
    scales: Sequence[int] = (1,)
    scale_samples: int = 10
    seed: int = 0
    coverage: Sequence[Coverage] = ()

    @property
    def row_count(self) -> int:
        """The number of rows of the whole run, or a little more."""
        larger = min(self.scale_samples, len(self.samples)) * len(self.scales)
        return (len(self.samples) + larger) * len(engine.list_variants(self.methods, self.sources))

    def tasks(self, done: Finished | None = None) -> list[Task]:
        """Return the tasks without the rows that are `done`."""
        pairs = sample_pairs(self.samples, self.scales, self.scale_samples, self.seed)
        variants = engine.list_variants(self.methods, self.sources)
        return engine.make_tasks(pairs, variants, self.sources, self.settings, done)


def add_folder(group: Any, out: str) -> None:  # noqa: ANN401 - argparse keeps its type private
    """Add the options of the results folder of a run; `out` is the default one."""
    group.set_defaults(default_out=out)
    text = f'folder for the results (default: {out}, or {out}-2 and so on where that has some)'
    option(group, '--out DIR', text)
    again = group.add_mutually_exclusive_group()
    option(again, '--resume', 'continue an interrupted run: that in --out, or the last one')
    option(again, '--overwrite', 'replace the results in --out by those of this run')


def choose_folder(out: str | None, default: str, *, resume: bool) -> ResultsFolder:
    """Return the results folder of a run.

    Without `out` every run gets its own: the default one, or the next by number without rows; to
    resume it is the last with rows.
    """
    folder = following = ResultsFolder(out or default)
    if out is None:
        for number in count(2):
            if not following.has_rows:
                break
            folder, following = following, ResultsFolder(f'{default}-{number}')
    return folder if resume else following


def is_parquet_run(file_format: str | None, rows: int = 0) -> bool:
    """Tell whether a new run of so many rows is written to Parquet parts.

    Without a format in FORMATS large runs are.
    """
    return file_format == PARQUET or (file_format is None and rows >= LARGE_RUN)


def open_folder(
    folder: ResultsFolder,
    metadata: dict[str, Any],
    *,
    resume: bool,
    overwrite: bool = False,
    parquet: bool = False,
) -> Finished:
    """Start, replace or resume a results folder; return the keys of the finished rows.

    A resumed folder keeps its format. Resuming drops the rows whose source never answered, so
    that it is asked again, and adds the seconds spent before to `metadata`. Raises ResultsError.
    """
    folder.claim()
    folder.require_own()
    if not (resume and folder.results.exists()):
        if overwrite:
            folder.discard_results()
        folder.require_new()
        # Before results.csv: a run that is killed between the two is started again by --resume.
        folder.write_json('metadata.json', metadata)
        folder.start(parquet=parquet)
        return {}
    before = folder.read_metadata()
    if changed := run_differences(before, metadata):
        message = f'{folder.path}: cannot be resumed, because these differ: {", ".join(changed)}'
        raise ResultsError(message)
    if changed := changed_inputs(before, metadata):
        metadata['notes'] = [*metadata.get('notes', []), *changed]
    metadata['seconds'] = float(before.get('seconds') or 0.0)
    return folder.keep_answered()


def changed_inputs(before: Mapping[str, Any], now: Mapping[str, Any]) -> list[str]:
    """Return a sentence for each input, such as a transcript, that earlier rows had another of."""
    files, notes = before.get('files') or {}, before.get('notes') or []
    changed = [
        f'{name}{ANOTHER_INPUT}'
        for name, digest in (now.get('files') or {}).items()
        if files.get(name, digest) != digest
    ]
    return list(dict.fromkeys([*(note for note in notes if ANOTHER_INPUT in note), *changed]))


@contextmanager
def timing(metadata: dict[str, Any]) -> Iterator[None]:
    """Add the seconds of the block to the metadata of a run, also where it is interrupted."""
    begun = time.monotonic()
    try:
        yield
    finally:
        metadata['seconds'] = float(metadata.get('seconds', 0.0)) + time.monotonic() - begun


def run_into_folder(
    folder: ResultsFolder, tasks: Iterable[Task], jobs: int, step: Callable[[], object]
) -> None:
    """Run tasks, so many at a time, and append their rows; call `step` after each."""

    def keep(rows: list[Row]) -> None:
        folder.append(rows)
        step()

    executor = ThreadPoolExecutor(jobs)
    # Tasks that are made one by one hold a map each, so fewer of them are queued.
    queued = 2 * jobs if isinstance(tasks, list) else jobs
    try:
        engine.run_tasks(tasks, executor, queued, keep)
    finally:
        # Requests that are still in flight may take long, and nothing needs their answers now.
        executor.shutdown(wait=False, cancel_futures=True)


def describe_unanswered(rows: Iterable[Row] | StoredRows) -> Iterator[str]:
    """Yield a line for each variant whose source left samples unanswered."""
    stored = StoredRows.of(rows)
    for variant in stored.variants(UNANSWERED):
        found = stored.arrays('unanswered', *variant)
        counts = ', '.join(map('{} {}'.format, found['source_status'], found['times']))
        yield (
            f'{variant}: {found["times"].sum()} samples without an answer ({counts}), '
            f'the first {found["place"][0]}'
        )


@contextmanager
def progress(total: int | None, unit: str = 'sample') -> Iterator[Callable[[], object]]:
    """Yield the function to call after each of `total` steps; None where the total is unknown.

    Without a terminal a line is written after every tenth of the steps.
    """
    if sys.stderr.isatty():
        with tqdm(total=total, unit=unit, file=sys.stderr) as bar:
            yield lambda: bool(bar.update())
        return
    of_total, steps = '' if total is None else f' of {total}', count(1)

    def step() -> None:
        done, parts = next(steps), (1, UNKNOWN_STRIDE) if total is None else (10, total)
        if done * parts[0] // parts[1] > (done - 1) * parts[0] // parts[1]:
            sys.stderr.write(f'{done}{of_total} {unit}s\n')
            sys.stderr.flush()

    yield step
