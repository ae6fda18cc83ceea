import csv
import os

import pytest

from benchmarks import guided_search


@pytest.fixture(scope='module')
def rows():
    folder = os.environ.get(guided_search.ENVIRONMENT)
    if not folder:
        pytest.skip(f'{guided_search.ENVIRONMENT} is not set')
    return guided_search.compare(folder, limit=30)


def test_the_bound_holds_on_every_sample(rows):
    assert len({(row.map, row.pair) for row in rows}) == 30
    for row in rows:
        assert row.length <= row.suboptimality_bound * row.exact_length * (1.0 + 1e-7)
        if '1.1' in row.method:
            assert row.suboptimality_bound <= 1.1


def test_any_waypoints_cost_at_most_three_times_the_work_of_none(rows):
    none = {(row.method, row.map, row.pair): row for row in rows if row.waypoints == 'none'}
    for row in rows:
        if row.waypoints:
            assert row.expansions <= 3.0 * none[row.method, row.map, row.pair].expansions


def test_good_waypoints_save_most_of_the_work_and_some_of_what_landmarks_leave(rows):
    oracle, none = (
        [row for row in rows if (row.method, row.waypoints) == ('best effort', name)]
        for name in ('oracle', 'none')
    )
    assert sum(row.expansions for row in oracle) < 0.25 * sum(
        row.paper_expansions for row in oracle
    )
    assert sum(row.expansions for row in oracle) < sum(row.expansions for row in none)


def test_the_summary_has_a_line_a_method_and_set(rows):
    lines = guided_search.summary(rows).splitlines()
    assert len(lines) == 1 + 3 + 4 * len(guided_search.SETS)
    assert all(len(line) == len(lines[0]) for line in lines)


def test_the_csv_keeps_its_columns(rows, monkeypatch, tmp_path, capsys):
    monkeypatch.setattr(guided_search, 'compare', lambda folder: rows)
    arguments = ['--reference', 'x', '--csv', str(tmp_path / 'rows.csv')]
    assert guided_search.main(arguments) == 0
    assert capsys.readouterr().out == guided_search.summary(rows) + '\n'
    with (tmp_path / 'rows.csv').open() as file:
        first = next(csv.DictReader(file))
    assert int(first['operation']) == rows[0].expansions
    assert float(first['ratio']) == rows[0].suboptimality_bound
    assert float(first['exact_length']) == rows[0].exact_length
