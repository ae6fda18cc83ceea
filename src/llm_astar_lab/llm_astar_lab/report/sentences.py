# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""States the results in sentences: what the waypoints added over none, even if that is nothing."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

from llm_astar_planner.search.methods import WAYPOINT_METHODS

from llm_astar_lab.analysis.statistics import Interval
from llm_astar_lab.analysis.summary import (
    Growth,
    PairedComparison,
    RunSummary,
    is_baseline,
    is_learned,
)
from llm_astar_lab.results.row import WAYPOINTS_ONLY, Variant

# A slope of log work over log scale below this counts as near linear.
NEAR_LINEAR = 1.25
METHOD_LABELS = {
    'astar': 'A*',
    'exact_astar': 'exact A* (ours)',
    'weighted_astar': 'weighted A* (w = 2)',
    'dynamic_weighted_astar': 'dynamic weighted A* (w = 2)',
    WAYPOINTS_ONLY: 'waypoints alone',
    'llm_astar': 'LLM-A*',
    'guided': 'guided (ours)',
}
SOURCE_LABELS = {
    'coarse': 'the turns of the cheapest route on a coarser map',
    'straight': 'three points on the straight line',
    'oracle': 'the corners of the best path',
    'noisy': 'corners displaced by up to 3 cells',
    'reversed': 'the corners in reverse order',
    'random': 'random points',
}
EFFECT_SENTENCES = {
    'help': 'The waypoints saved work:',
    'harm': 'The waypoints did harm:',
    'nothing': 'The waypoints added nothing that can be told from chance:',
}


def method_label(method: str) -> str:
    """Return a method's name for people."""
    # Of a plug-in it may be code.
    plain = method if ':' in method else method.replace('_', ' ')
    return METHOD_LABELS.get(method, plain)


def variant_label(variant: Variant) -> str:
    """Return a variant's name for people."""
    guide = ', '.join(part for part in variant[1:] if part and part != 'none')
    has_none = variant.method in WAYPOINT_METHODS and variant.source == 'none'
    name = method_label(variant.method) + (', no waypoints' if has_none else '')
    return f'{name}, {guide}' if guide else name


def has_waypoints(variant: Variant) -> bool:
    """Tell whether a variant was given waypoints."""
    return variant.source != 'none' and variant.method != WAYPOINTS_ONLY


def counted(number: int, thing: str) -> str:
    """Return a number with its noun, in the plural except for 1."""
    return f'{number} {thing}' if number == 1 else f'{number} {thing}s'


def recorded_sentence(counts: Mapping[str, int]) -> str:
    """Say for how many requests the bags hold a plan, by `RunSummary.recorded`; '' for none."""
    if not counts or not (counts['plans'] or counts['empty']):
        return ''
    none = f' (it found none for {counts["empty"]})' if counts['empty'] else ''
    return (
        f"The robot's own plan is in the bags for {counts['plans']} of "
        f'{counted(counts["requests"], "request")}{none}; not valid on their map by these rules: '
        f'{counts["broken"]} (`recorded_problem` in results.csv says why).'
    )


def headline(comparisons: Sequence[PairedComparison]) -> str:
    """Say in one sentence what waypoints added: those of a model for LLM-A*, else the oracle's."""
    usable = [comparison for comparison in comparisons if comparison.samples]
    if not usable:
        return 'No method was run both with waypoints and without any: nothing to compare.'

    def rank(comparison: PairedComparison) -> tuple[bool, bool, bool]:
        variant = comparison.variant
        return is_baseline(variant), variant.method != 'llm_astar', variant.source != 'oracle'

    chosen = min(usable, key=rank)
    others = {item.variant[1:]: item for item in usable if item.failures}
    others.pop(chosen.variant[1:], None)
    named = [(describe_waypoints(item.variant), failure_text(item)) for item in others.values()]
    return ''.join(f'With {name} the source {text}. ' for name, text in named) + sentence(chosen)


def failure_text(comparison: PairedComparison) -> str:
    """Say on how many samples the source of a variant failed, and with which statuses."""
    failed = sum(comparison.failures.values())
    kinds = ', '.join(f'{name} {count}' for name, count in comparison.failures.items())
    return f'failed on {failed} of {counted(comparison.asked, "sample")} ({kinds})'


def sentence(comparison: PairedComparison) -> str:
    """Say what the waypoints of one variant added over none, with the confidence intervals."""
    work, length, variant = comparison.operation, comparison.length, comparison.variant
    found, (answered, usable) = EFFECT_SENTENCES[effect_on(work)], comparison.answered
    without = ''
    if comparison.failures:
        failed = f'The source {failure_text(comparison)}'
        if not usable:
            return f'{failed}: nothing is known of {describe_waypoints(variant)}.'
        found = f'{failed}, with these t{found[1:]}'
        change = describe_change(answered.value, 'more', 'fewer')
        interval = describe_interval(answered, 'more', 'fewer')
        without = f'; without them {change} ({interval}), over {counted(usable, "sample")}'
    return (
        f'{found} {method_label(variant.method)} with '
        f'{describe_waypoints(variant)} expanded {describe_change(work.value, "more", "fewer")} '
        f'nodes than with no waypoints ({describe_interval(work, "more", "fewer")}), on paths '
        f'{describe_change(length.value, "longer", "shorter")} '
        f'({describe_interval(length, "longer", "shorter")}), '
        f'over {counted(comparison.samples, "sample")} of {counted(comparison.maps, "map")}'
        f'{without}.'
    )


def growth_sentence(growths: Sequence[Growth]) -> str | None:
    """Say how the work of A* and LLM-A* grows with the map; None where either was not run."""
    work = [item for item in growths if item.quantity == 'operation' and item.samples]
    guided = [item for item in work if item.variant.method == 'llm_astar']
    plain = next((item for item in work if item.variant.method == 'astar'), None)
    if plain is None or not guided:
        return None
    chosen = min(
        guided, key=lambda item: (is_baseline(item.variant), item.variant.source != 'oracle')
    )
    near = 'near' if chosen.slope < NEAR_LINEAR else 'not near'
    return (
        f'From scale 1 to {chosen.scales[-1]} the work of LLM-A* with `{chosen.variant.source}` '
        f'waypoints grew {chosen.factors[-1]:.1f} times (slope {chosen.slope:.2f}) and that of A* '
        f'{plain.factors[-1]:.1f} times (slope {plain.slope:.2f}), over '
        f'{counted(chosen.samples, "sample")}: '
        f'{near} linear in the scale, which would be slope 1.'
    )


def effect_on(work: Interval) -> str:
    """Classify an effect on work: help, harm, or nothing where the interval holds 1."""
    if work.high < 1.0:
        return 'help'
    return 'harm' if work.low > 1.0 else 'nothing'


def describe_waypoints(variant: Variant) -> str:
    """Say whose waypoints a variant was given."""
    if is_baseline(variant):
        what = SOURCE_LABELS.get(variant.source, variant.source)
        return f'`{variant.source}` waypoints ({what})'
    if is_learned(variant):
        return f'the waypoints of `{variant.source}` (a learned model, not an LLM)'
    named = ', '.join(part for part in (variant.model, variant.prompt) if part)
    return f'the waypoints of `{variant.source}`' + (f' ({named})' if named else '')


def describe_change(ratio: float, more: str, less: str) -> str:
    """Write a ratio as a change in percent, such as `5.00 % fewer`."""
    return f'{100.0 * abs(ratio - 1.0):.2f} % {more if ratio >= 1.0 else less}'


def describe_interval(interval: Interval, more: str, less: str) -> str:
    """Write an interval of a ratio as changes in percent."""
    if math.isnan(interval.low):
        return 'one map gives no interval'
    low, high = (describe_change(end, more, less) for end in (interval.low, interval.high))
    if (interval.low < 1.0) == (interval.high < 1.0):
        # Both limits have the same direction: name it once, the smaller number first.
        ends = sorted(100.0 * abs(end - 1.0) for end in (interval.low, interval.high))
        low, high = f'{ends[0]:.2f}', f'{ends[1]:.2f} % {more if interval.low >= 1.0 else less}'
    return f'95 % interval: {low} to {high}'


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
