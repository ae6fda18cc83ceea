import os

import pytest

from benchmarks import guided_search as guided_table


@pytest.fixture(scope='module')
def rows():
    folder = os.environ.get(guided_table.ENVIRONMENT)
    if not folder:
        pytest.skip(f'{guided_table.ENVIRONMENT} is not set')
    return guided_table.compare(folder, limit=30)


def test_the_bound_holds_on_every_sample(rows):
    assert len({(row.map, row.pair) for row in rows}) == 30
    for row in rows:
        assert row.length <= row.ratio * row.exact_length * (1.0 + 1e-7)
        if '1.1' in row.method:
            assert row.ratio <= 1.1


def test_any_waypoints_cost_at_most_three_times_the_work_of_none(rows):
    none = {(row.method, row.map, row.pair): row for row in rows if row.waypoints == 'none'}
    for row in rows:
        if row.waypoints:
            assert row.operation <= 3.0 * none[row.method, row.map, row.pair].operation


def test_good_waypoints_save_most_of_the_work_and_some_of_what_landmarks_leave(rows):
    oracle, none = (
        [row for row in rows if (row.method, row.waypoints) == ('best effort', name)]
        for name in ('oracle', 'none')
    )
    assert sum(row.operation for row in oracle) < 0.25 * sum(row.paper_operation for row in oracle)
    assert sum(row.operation for row in oracle) < sum(row.operation for row in none)


def test_the_summary_has_a_line_a_method_and_set(rows):
    lines = guided_table.summary(rows).splitlines()
    assert len(lines) == 1 + 3 + 4 * len(guided_table.SETS)
    assert all(len(line) == len(lines[0]) for line in lines)
