import argparse

import pytest

from benchmarks import false_alarms


def simulated(maps, **values):
    options = {
        'variants': 29, 'samples': 10 * maps, 'times': 60, 'noise': 'normal', 'map_noise': 0.3,
        'power': False, 'seed': 0,
    }  # fmt: skip
    return false_alarms.measure(maps, argparse.Namespace(**{**options, **values}))


@pytest.mark.parametrize('maps', [3, 10, 100])
def test_equal_runs_of_29_variants_seldom_have_a_regression(maps):
    alarms, _, _ = simulated(maps)
    assert alarms <= 0.1  # 5 % are meant; 7 of 60 would be so by chance in 2 of 100 seeds


def test_the_power_that_is_stated_is_that_of_the_simulation():
    _, found, stated = simulated(60, variants=1, times=200, power=True, map_noise=0.1)
    assert found == pytest.approx(stated, abs=0.1)
    assert 0.4 < stated < 0.9
