"""How long the tasks of a run will take, foretold by the first of them."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence

from llm_astar_planner.benchmark.runner.engine import Task

# The first tasks of a scale that are timed; the more there are, the better the forecast.
TIMED_PART, MOST_TIMED = 0.02, 20
# Tasks differ: later ones may have more to search.
MARGIN = 1.5
# Shorter runs need no forecast, seconds.
WORTH_SAYING = 10.0


def split_timed(tasks: Sequence[Task]) -> tuple[dict[int, list[Task]], list[Task]]:
    """Return the first tasks of each scale, which are run first and timed, and the others."""
    timed: dict[int, list[Task]] = {}
    others: list[Task] = []
    counts = Counter(task.scale for task in tasks)
    for task in tasks:
        group = timed.setdefault(task.scale, [])
        most = min(MOST_TIMED, max(1, round(TIMED_PART * counts[task.scale])))
        (group if len(group) < most else others).append(task)
    return timed, others


def forecast(others: Sequence[Task], seconds: Mapping[int, float]) -> str | None:
    """Say how long tasks take at most, by `seconds` a task at each scale; None if not long."""
    longest = MARGIN * sum(seconds[task.scale] for task in others)
    if longest < WORTH_SAYING:
        return None
    return f'{len(others)} more samples, {describe_seconds(longest)} at most'


def describe_seconds(seconds: float) -> str:
    """Return a duration in the unit that a person would use."""
    for unit, size in (('hours', 3600.0), ('minutes', 60.0)):
        if seconds > 1.5 * size:
            return f'about {seconds / size:.2g} {unit}'
    return f'about {seconds:.2g} seconds'
