from types import SimpleNamespace

from llm_astar_lab.runner.config import forecast, split_timed

TASKS = [SimpleNamespace(scale=scale) for scale in [1] * 1000 + [5] * 10]


def test_the_first_tasks_of_each_scale_are_timed_and_none_is_lost():
    timed, others = split_timed(TASKS)
    assert {scale: len(group) for scale, group in timed.items()} == {1: 20, 5: 1}
    assert sorted(map(id, [*timed[1], *timed[5], *others])) == sorted(map(id, TASKS))


def test_the_forecast_counts_each_scale_by_its_own_time():
    _, others = split_timed(TASKS)
    # (980 * 0.1 s + 9 * 4 s) and half of that as a margin.
    assert forecast(others, {1: 0.1, 5: 4.0}) == '989 more samples, about 3.3 minutes at most'
    assert forecast(others, {1: 1.0, 5: 900.0}) == '989 more samples, about 3.8 hours at most'


def test_a_short_run_is_not_foretold():
    assert forecast(split_timed(TASKS)[1], {1: 0.001, 5: 0.01}) is None
