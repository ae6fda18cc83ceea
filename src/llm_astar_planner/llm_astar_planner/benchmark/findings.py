"""What the figures say, in sentences: what waypoints added over none, also where it is nothing."""

from __future__ import annotations

from collections.abc import Sequence

from llm_astar_planner.benchmark.statistics import Interval
from llm_astar_planner.benchmark.summary import Contrast, is_ablation

LABELS = {
    'astar': 'A*',
    'weighted_astar': 'weighted A* (w = 2)',
    'dynamic_weighted_astar': 'dynamic weighted A* (w = 2)',
    'llm_only': 'waypoints alone',
    'llm_astar': 'LLM-A*',
}
SOURCES = {
    'straight': 'three points on the straight line',
    'oracle': 'the corners of the best path',
    'noisy': 'corners displaced by up to 3 cells',
    'reversed': 'the corners in reverse order',
    'random': 'random points',
}


def label(method: str) -> str:
    """Return a method's name for people."""
    return LABELS.get(method, method.replace('_', ' '))


def headline(contrasts: Sequence[Contrast]) -> str:
    """Say in one sentence what waypoints added: a model's for LLM-A*, or else the oracle's."""
    searched = [contrast for contrast in contrasts if contrast.samples]
    if not searched:
        return 'No case with waypoints was run beside the same method without: nothing to compare.'

    def rank(contrast: Contrast) -> tuple[bool, bool, bool]:
        case = contrast.case
        return is_ablation(case), case.method != 'llm_astar', case.source != 'oracle'

    return sentence(min(searched, key=rank))


def sentence(contrast: Contrast) -> str:
    """Say what one case's waypoints added over none, with the confidence interval."""
    case, work = contrast.case, contrast.operation
    return (
        f'{_verdict(work)} {label(case.method)} with {_who(contrast)} expanded '
        f'{_change(work.value, "more", "fewer")} nodes than with no waypoints '
        f'({_interval(work, "more", "fewer")}), on paths '
        f'{_change(contrast.length.value, "longer", "shorter")} '
        f'({_interval(contrast.length, "longer", "shorter")}), '
        f'over {contrast.samples} samples of {contrast.maps} maps.'
    )


def verdict(work: Interval) -> str:
    """Name an effect on work: help, harm, or nothing where the interval holds no effect at all."""
    if work.high < 1.0:
        return 'help'
    return 'harm' if work.low > 1.0 else 'nothing'


def _verdict(work: Interval) -> str:
    return {
        'help': 'The waypoints saved work:',
        'harm': 'The waypoints did harm:',
        'nothing': 'The waypoints added nothing that can be told from chance:',
    }[verdict(work)]


def _who(contrast: Contrast) -> str:
    case = contrast.case
    if is_ablation(case):
        return f'`{case.source}` waypoints ({SOURCES.get(case.source, case.source)})'
    named = ', '.join(part for part in (case.model, case.prompt) if part)
    return f'the waypoints of `{case.source}`' + (f' ({named})' if named else '')


def _change(ratio: float, more: str, less: str) -> str:
    percent = 100.0 * abs(ratio - 1.0)
    return f'{percent:.2f} % {more if ratio >= 1.0 else less}'


def _interval(interval: Interval, more: str, less: str) -> str:
    low, high = (_change(end, more, less) for end in (interval.low, interval.high))
    return f'95 % interval: {low} to {high}'
