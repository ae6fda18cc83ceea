"""How long the tasks of a run will take, foretold by the first of them."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence

# The first tasks of a scale that are timed; the more there are, the better the forecast.
TIMED_PART, MOST_TIMED = 0.02, 20
# Tasks differ: later ones may have more to search.
MARGIN = 1.5
# Shorter runs need no forecast, seconds.
WORTH_SAYING = 10.0


def split_timed(scales: Sequence[int]) -> tuple[dict[int, list[int]], list[int]]:
    """Return the indices of the first tasks of each scale, to be timed, and of the others.

    `scales` has the scale of each task.
    """
    timed: dict[int, list[int]] = {}
    others: list[int] = []
    counts = Counter(scales)
    for index, scale in enumerate(scales):
        group = timed.setdefault(scale, [])
        most = min(MOST_TIMED, max(1, round(TIMED_PART * counts[scale])))
        (group if len(group) < most else others).append(index)
    return timed, others


def forecast(scales: Sequence[int], seconds: Mapping[int, float]) -> str | None:
    """Say how long tasks of these scales take at most; None if not long.

    `seconds` is the time of a task at each scale.
    """
    longest = MARGIN * sum(seconds[scale] for scale in scales)
    if longest < WORTH_SAYING:
        return None
    return f'{len(scales)} more samples, {describe_seconds(longest)} at most'


def describe_seconds(seconds: float) -> str:
    """Return a duration in the unit that a person would use."""
    for unit, size in (('hours', 3600.0), ('minutes', 60.0)):
        if seconds > 1.5 * size:
            return f'about {seconds / size:.2g} {unit}'
    return f'about {seconds:.2g} seconds'
