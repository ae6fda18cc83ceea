"""No kernel reads or writes beyond its arrays, as numba's bounds check sees it.

Compiled code checks no index by itself; a wrong one may read what it should not, and crash later.
"""

import os
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
# Everything that compiled code has tests for; each is compiled anew with its checks.
TESTED = [f'src/llm_astar_planner/test/{room}' for room in ('search', 'costmap', 'planning')]


def checked(folder, *command, seconds, codes=(0,)):
    """Run a command with numba's bounds check, and what it compiles in a folder of its own."""
    environment = os.environ | {'NUMBA_BOUNDSCHECK': '1', 'NUMBA_CACHE_DIR': str(folder)}
    ended = subprocess.run(
        [sys.executable, *command],
        cwd=ROOT,
        env=environment,
        capture_output=True,
        text=True,
        timeout=seconds,
    )
    assert ended.returncode in codes, ended.stdout[-3000:] + ended.stderr[-3000:]
    return ended.stdout


def test_the_bounds_check_finds_an_index_out_of_bounds(tmp_path):
    with pytest.raises(AssertionError, match='IndexError: index is out of bounds'):
        checked(
            tmp_path,
            '-c',
            'import numba, numpy; numba.njit(lambda a, i: a[i])(numpy.zeros(3), 3)',
            seconds=200,
        )


def test_the_first_search_keeps_within_its_arrays_on_maps_about_the_size_of_a_tile(tmp_path):
    output = checked(
        tmp_path, 'test/bounds_checked.py', 'exact_astar', '1,63,64,65', '2', seconds=230
    )
    assert output == '24 plans\n'


@pytest.mark.slow
@pytest.mark.timeout(7200)
def test_every_search_keeps_within_its_arrays_on_maps_of_awkward_sizes(tmp_path):
    methods = 'guided,exact_astar,llm_astar,astar,weighted_astar,dynamic_weighted_astar'
    checked(tmp_path, 'test/bounds_checked.py', methods, '', '20', seconds=3600)


@pytest.mark.slow
@pytest.mark.timeout(7200)
def test_no_test_of_kernels_meets_an_index_out_of_bounds(tmp_path):
    quiet = ('-q', '-p', 'no:cacheprovider', '--timeout', '3600')
    # Checks take time, so tests of deadlines may fail.
    output = checked(tmp_path, '-m', 'pytest', *quiet, *TESTED, seconds=7000, codes=(0, 1))
    assert ' passed' in output
    assert 'IndexError' not in output
