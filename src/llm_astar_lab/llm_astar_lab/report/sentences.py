# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""Names and sentences of reports: what the waypoints added over none, even if that is nothing.

The sentences themselves are in `sentences.j2`.
"""

from collections.abc import Mapping, Sequence
from functools import partial

from llm_astar_planner.search.methods import WAYPOINT_METHODS

from llm_astar_lab.analysis.statistics import Interval
from llm_astar_lab.analysis.summary import Growth, PairedComparison, RunSummary
from llm_astar_lab.results.row import WAYPOINTS_ONLY, Variant
from llm_astar_lab.templates import TEMPLATES

METHOD_LABELS = {
    'astar': 'A*', 'exact_astar': 'exact A* (ours)', 'weighted_astar': 'weighted A* (w = 2)',
    'dynamic_weighted_astar': 'dynamic weighted A* (w = 2)', WAYPOINTS_ONLY: 'waypoints alone',
    'llm_astar': 'LLM-A*', 'guided': 'guided (ours)',
}  # fmt: skip


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


def model_label(variant: Variant) -> str:
    """Return the model or source of a variant, and what tells it from one of the same name."""
    if variant.is_learned:
        return f'{variant.source} (learned, not an LLM)'
    _, _, transcript = variant.source.partition('replay:')
    name = variant.model or variant.source
    return f'{name} ({transcript})' if transcript else name


def has_waypoints(variant: Variant) -> bool:
    """Tell whether a variant was given waypoints."""
    return variant.source != 'none' and variant.method != WAYPOINTS_ONLY


def shares_text(shares: Mapping[str, float]) -> str:
    """Write named shares in percent, a dash for none."""
    return ', '.join(f'{name} {100 * part:.1f}' for name, part in shares.items()) or '-'


def counts_text(counts: Mapping[str, int]) -> str:
    """Write named numbers, a dash for none."""
    return ', '.join(f'{name} {number}' for name, number in counts.items()) or '-'


def counted(number: int, thing: str) -> str:
    """Return a number with its noun, in the plural except for 1."""
    return f'{number} {thing}' if number == 1 else f'{number} {thing}s'


def effect_on(work: Interval) -> str:
    """Classify an effect on work: help, harm, or nothing where the interval holds 1."""
    if work.high < 1.0:
        return 'help'
    return 'harm' if work.low > 1.0 else 'nothing'


SENTENCES = TEMPLATES.get_template(
    'report/sentences.j2',
    globals={
        'method': method_label, 'counts': counts_text, 'counted': counted, 'effect': effect_on,
    },
)  # fmt: skip


def say(name: str, *values: object) -> str:
    """Return the sentence of this name about the values, '' for none."""
    text: str = getattr(SENTENCES.module, name)(*values)
    return ' '.join(text.split())


# What the waypoints of one variant added over none, with the confidence intervals.
sentence = partial(say, 'sentence')


def headline(comparisons: Sequence[PairedComparison]) -> str:
    """Say in one sentence what waypoints added: those of a model for LLM-A*, else the oracle's."""
    usable = [comparison for comparison in comparisons if comparison.samples]
    if not usable:
        return 'No method was run both with waypoints and without any: nothing to compare.'
    chosen = min(usable, key=lambda item: rank(item.variant))
    others = {item.variant[1:]: item for item in usable if item.failures}
    others.pop(chosen.variant[1:], None)
    return say('headline', list(others.values()), chosen)


def rank(variant: Variant) -> tuple[bool, bool, bool]:
    """Return the sort key of what a headline is about."""
    return variant.is_baseline, variant.method != 'llm_astar', variant.source != 'oracle'


def growth_sentence(growths: Sequence[Growth]) -> str:
    """Say how the work of A* and LLM-A* grows with the map; '' where either was not run."""
    work = [item for item in growths if item.quantity == 'operation' and item.samples]
    guided = [item for item in work if item.variant.method == 'llm_astar']
    plain = next((item for item in work if item.variant.method == 'astar'), None)
    if plain is None or not guided:
        return ''
    return say('growth', min(guided, key=lambda item: rank(item.variant)), plain)


def provenance(run: RunSummary) -> str:
    """Say which samples, settings, version and machine the figures come from."""
    most = max(run.variants, key=lambda summary: summary.samples, default=None)
    return say('provenance', run.metadata, most)
