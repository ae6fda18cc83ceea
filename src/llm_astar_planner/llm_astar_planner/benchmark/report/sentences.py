"""What the figures say, in sentences: what waypoints added over none, also where it is nothing."""

from __future__ import annotations

import math
from collections.abc import Sequence

from llm_astar_planner.benchmark.analysis.scalability import Growth
from llm_astar_planner.benchmark.analysis.statistics import Interval
from llm_astar_planner.benchmark.analysis.summary import Contrast, is_ablation, is_learned
from llm_astar_planner.benchmark.results import Row

# Growth below this slope of log work over log scale passes as near linear.
NEAR_LINEAR = 1.25
LABELS = {
    'astar': 'A*',
    'exact_astar': 'exact A* (ours)',
    'weighted_astar': 'weighted A* (w = 2)',
    'dynamic_weighted_astar': 'dynamic weighted A* (w = 2)',
    'llm_only': 'waypoints alone',
    'llm_astar': 'LLM-A*',
    'guided': 'guided (ours)',
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


def counted(number: int, thing: str) -> str:
    """Write so many things, in the plural but for one."""
    return f'{number} {thing}' if number == 1 else f'{number} {thing}s'


def recorded_sentence(rows: Sequence[Row]) -> str:
    """Say for how many requests of bags a plan was recorded, '' where there are none."""
    requests = {row.key[:2]: row for row in rows if row.bag}.values()
    plans = [row for row in requests if row.recorded_length >= 0]
    broken = sum(bool(row.recorded_problem) for row in plans)
    # An empty path has no length, and that is its problem.
    empty = sum(bool(row.recorded_problem) for row in requests) - broken
    if not plans and not empty:
        return ''
    none = f' (it found none for {empty})' if empty else ''
    return (
        f"The robot's own plan is in the bags for {len(plans)} of "
        f'{counted(len(requests), "request")}{none}; not valid on their map by these rules: '
        f'{broken} (`recorded_problem` in results.csv says why).'
    )


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
        f'over {counted(contrast.samples, "sample")} of {counted(contrast.maps, "map")}.'
    )


def growth_sentence(growths: Sequence[Growth]) -> str:
    """Say how work grows with the map for A* and LLM-A*, and whether that is near linear."""
    work = [item for item in growths if item.quantity == 'operation' and item.samples]
    guided = [item for item in work if item.case.method == 'llm_astar']
    plain = next((item for item in work if item.case.method == 'astar'), None)
    if plain is None or not guided:
        return ''
    chosen = min(guided, key=lambda item: (is_ablation(item.case), item.case.source != 'oracle'))
    near = 'near' if chosen.slope < NEAR_LINEAR else 'not near'
    return (
        f'From scale 1 to {chosen.scales[-1]} the work of LLM-A* with `{chosen.case.source}` '
        f'waypoints grew {chosen.factors[-1]:.1f} times (slope {chosen.slope:.2f}) and that of A* '
        f'{plain.factors[-1]:.1f} times (slope {plain.slope:.2f}), over '
        f'{counted(chosen.samples, "sample")}: '
        f'{near} linear in the scale, which would be slope 1.'
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
    if is_learned(case):
        return f'the waypoints of `{case.source}` (a learned model, not an LLM)'
    named = ', '.join(part for part in (case.model, case.prompt) if part)
    return f'the waypoints of `{case.source}`' + (f' ({named})' if named else '')


def _change(ratio: float, more: str, less: str) -> str:
    percent = 100.0 * abs(ratio - 1.0)
    return f'{percent:.2f} % {more if ratio >= 1.0 else less}'


def _interval(interval: Interval, more: str, less: str) -> str:
    if math.isnan(interval.low):
        return 'one map gives no interval'
    low, high = (_change(end, more, less) for end in (interval.low, interval.high))
    if (interval.low < 1.0) == (interval.high < 1.0):
        # Both ends point one way: name it once, the smaller number first.
        ends = sorted(100.0 * abs(end - 1.0) for end in (interval.low, interval.high))
        low, high = f'{ends[0]:.2f}', f'{ends[1]:.2f} % {more if interval.low >= 1.0 else less}'
    return f'95 % interval: {low} to {high}'
