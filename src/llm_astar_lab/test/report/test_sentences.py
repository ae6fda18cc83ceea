"""The sentences say what the figures say, whether the waypoints helped or not."""

import pytest
from benchmark_samples import MODEL, rows_with
from llm_astar_lab.analysis.statistics import Interval
from llm_astar_lab.analysis.summary import PairedComparison, compare_with_none
from llm_astar_lab.report.sentences import effect_on, headline, sentence


@pytest.mark.parametrize(
    ('factor', 'spread', 'word', 'start'),
    [
        (0.8, 0.05, 'help', 'The waypoints saved work'),
        (1.3, 0.05, 'harm', 'The waypoints did harm'),
        (1.0, 0.5, 'nothing', 'The waypoints added nothing that can be told from chance'),
    ],
)
def test_the_finding_follows_the_interval(factor, spread, word, start):
    (comparison,) = compare_with_none(rows_with(factor, spread))
    assert effect_on(comparison.operation) == word
    text = sentence(comparison)
    assert text.startswith(start)
    assert '95 % interval' in text
    assert 'over 40 samples of 20 maps' in text


def test_the_sentence_says_help_and_harm_in_numbers():
    comparison = PairedComparison(
        MODEL, 500, 50, Interval(0.8, 0.75, 0.9), Interval(1.01, 0.999, 1.02)
    )
    assert sentence(comparison) == (
        'The waypoints saved work: LLM-A* with the waypoints of `replay` (parrot-1, few_shot) '
        'expanded 20.00 % fewer nodes than with no waypoints (95 % interval: 10.00 to 25.00 % '
        'fewer), on paths 1.00 % longer (95 % interval: 0.10 % shorter to 2.00 % longer), over '
        '500 samples of 50 maps.'
    )


def test_the_headline_is_about_the_model_where_there_is_one():
    rows = rows_with(0.8) + [r for r in rows_with(1.4, variant=MODEL) if r.variant == MODEL]
    assert 'parrot-1' in headline(compare_with_none(rows))
    assert '`oracle`' in headline(compare_with_none(rows_with(0.8)))
    assert 'nothing to compare' in headline([])
