"""One benchmark run: what to run, where to, and how it went."""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from llm_astar_planner.benchmark.datasets.samples import BenchmarkSample, draw
from llm_astar_planner.benchmark.results import (
    ResultsError,
    ResultsFolder,
    Row,
    RowKey,
    describe_run,
    differences,
)
from llm_astar_planner.benchmark.runner.engine import (
    Asker,
    Outcome,
    Settings,
    Task,
    plan_cases,
    plan_tasks,
    run_tasks,
)


@dataclass(frozen=True)
class Sweep:
    """What a run covers.

    Scale 1 runs all `samples`; every other scale, and scale 1 with them, `scale_samples` drawn.
    `files` are transcripts and prompts whose digests belong to the run.
    """

    dataset: Path
    samples: Sequence[BenchmarkSample]
    methods: Sequence[str]
    askers: Sequence[Asker]
    settings: Settings
    scales: Sequence[int] = (1,)
    scale_samples: int = 10
    seed: int = 0
    files: Sequence[Path] = ()

    def tasks(self, done: frozenset[RowKey] = frozenset()) -> list[Task]:
        """Return the tasks that are not `done`."""
        pairs = [(sample, 1) for sample in self.samples if 1 in self.scales]
        larger = [scale for scale in self.scales if scale != 1]
        if larger:
            drawn = draw(self.samples, self.scale_samples, self.seed)
            pairs += [(sample, scale) for scale in (1, *larger) for sample in drawn]
        cases = plan_cases(self.methods, self.askers)
        return plan_tasks(pairs, cases, self.askers, self.settings, done)


def begin(
    folder: ResultsFolder, sweep: Sweep, parameters: dict[str, Any], *, resume: bool
) -> tuple[list[Task], dict[str, Any]]:
    """Start a folder, or go on with it; return the tasks left and the run's metadata.

    Going on asks again what no source answered. Raises ResultsError where rows of another dataset,
    version or seed lie there.
    """
    metadata = describe_run([sweep.dataset], parameters, sweep.files)
    return sweep.tasks(open_folder(folder, metadata, resume=resume)), metadata


def open_folder(
    folder: ResultsFolder, metadata: dict[str, Any], *, resume: bool
) -> frozenset[RowKey]:
    """Start a folder, or go on with it; return the keys of the rows done. Raises ResultsError."""
    if resume and folder.results.exists():
        return _go_on(folder, metadata)
    folder.refuse_old()
    # First, so that a run cut off between the two is begun anew by --resume.
    folder.write_json('metadata.json', metadata)
    folder.start()
    return frozenset()


def carry_out(
    folder: ResultsFolder,
    tasks: Iterable[Task],
    executor: Executor,
    at_once: int,
    *,
    metadata: dict[str, Any],
    step: Callable[[Task, list[Outcome]], object],
) -> None:
    """Run tasks into a folder, `step` after each; the time goes into the metadata in any case."""

    def keep(task: Task, outcomes: list[Outcome]) -> None:
        folder.append(outcome.row for outcome in outcomes)
        step(task, outcomes)

    begun = time.monotonic()
    try:
        run_tasks(tasks, executor, at_once, keep)
    finally:
        metadata['seconds'] = float(metadata.get('seconds', 0.0)) + time.monotonic() - begun


def unanswered(rows: Sequence[Row]) -> list[str]:
    """Say, a line a case, for how many samples its source never answered, and the first one."""
    missing = [row for row in rows if not row.answered]
    lines = []
    for case in dict.fromkeys(row.case for row in missing):
        of = [row for row in missing if row.case == case]
        counts = Counter(row.source_status for row in of)
        how = ', '.join(f'{status} {count}' for status, count in counts.items())
        first = f'map {of[0].map}, pair {of[0].pair}, scale {of[0].scale}'
        lines.append(f'{case}: {len(of)} samples without an answer ({how}), the first {first}')
    return lines


def _go_on(folder: ResultsFolder, metadata: dict[str, Any]) -> frozenset[RowKey]:
    """Go on with a folder: drop the rows no source answered, return the keys of the others.

    The seconds spent before go into `metadata`. Raises ResultsError.
    """
    before = folder.read_json('metadata.json')
    changed = differences(before, metadata)
    if changed:
        message = f'{folder.path}: cannot go on, another run made it: {", ".join(changed)} differ'
        raise ResultsError(message)
    rows = [row for row in folder.read() if row.answered]
    folder.rewrite(rows)
    metadata['seconds'] = float(before.get('seconds') or 0.0)
    return frozenset(row.key for row in rows)
