"""Thresholds are parsed, met and missed."""

from dataclasses import replace

import pytest
from benchmark_samples import rows_with
from llm_astar_lab.analysis.summary import summarise
from llm_astar_lab.analysis.thresholds import missed_thresholds, parse_threshold
from llm_astar_lab.results.row import Variant


def test_ratios_are_missed_above_and_shares_below_their_threshold():
    summaries = summarise(rows_with(0.8))
    limits = ['llm_astar/oracle:operation=41', 'astar:valid=100', 'llm_astar/oracle:length=104']
    assert missed_thresholds(summaries, [parse_threshold(text) for text in limits]) == []
    tight = ['llm_astar/oracle:operation=39', 'llm_astar/oracle:optimal=50', 'nobody:valid=1']
    lines = missed_thresholds(summaries, [parse_threshold(text) for text in tight])
    assert 'operation 40.00 % is above 39' in lines[0]
    assert 'optimal 0.00 % is below 50' in lines[1]
    assert 'nobody: was not run; available are astar/none' in lines[2]


def test_a_threshold_holds_for_all_variants_whose_names_begin_so():
    rows = rows_with(0.8, variant=Variant('llm_astar', 'replay', model='m1'))
    limit = [parse_threshold('llm_astar/replay:operation=1')]
    assert [line.split(':')[0] for line in missed_thresholds(summarise(rows), limit)] == [
        'llm_astar/replay/m1'
    ]


def test_variants_that_read_alike_are_both_held_to_a_threshold():
    first, second = (
        Variant('llm_astar', 'replay', *names) for names in (('a/b', 'c'), ('a', 'b/c'))
    )
    more = [row for row in rows_with(0.1, variant=second) if row.variant == second]
    rows = [*rows_with(0.8, variant=first), *more]
    limit = [parse_threshold('llm_astar/replay:operation=20')]
    assert len(missed_thresholds(summarise(rows), limit)) == 1
    assert len(missed_thresholds(summarise(rows[::-1]), limit)) == 1


def test_a_threshold_without_a_variant_holds_for_all_that_have_the_metric():
    limit = [parse_threshold('instruction=60')]
    rows = rows_with(0.8)
    (line,) = missed_thresholds(summarise(rows), limit)
    assert line == 'instruction is unknown, so the limit 60 is not met'
    # Of one variant, half the instructions are satisfied; the others had none.
    asked = [
        replace(row, instruction_satisfied=float(row.pair)) if row.source == 'oracle' else row
        for row in rows
    ]
    summaries = summarise(asked)
    shares = {str(item.variant): item.instruction.value for item in summaries}
    assert shares['llm_astar/oracle'] == 0.5
    assert missed_thresholds(summaries, [parse_threshold('instruction=50')]) == []
    assert missed_thresholds(summaries, limit) == [
        'llm_astar/oracle: instruction 50.00 % is below 60'
    ]


@pytest.mark.parametrize(
    'text', ['', 'a', 'a:operation', 'a:speed=3', 'a:length=fast', ':valid=1']
)
def test_bad_thresholds_are_named(text):
    with pytest.raises(ValueError, match=r'is expected|is not a number'):
        parse_threshold(text)
