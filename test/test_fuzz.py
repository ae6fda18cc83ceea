"""Damaged files and texts: every reader reads them or says in one error what is wrong with them.

`make soak` reads 100,000 mutations for each reader.
"""

import os

import pytest
from fuzz_readers import READERS
from fuzzing import MOST_BYTES, run_outside

# The time of the whole module counts as that of its first test.
pytestmark = pytest.mark.timeout(900)
MUTATIONS = 200
# Of readers that take a tenth of a second and more each time: bags, and what is solved or
# understood at once; a folder of results is summed up and reported anew.
FEWER = {
    **dict.fromkeys(('bag_mcap', 'bag_sqlite3', 'bag_metadata', 'reply_to_instruction'), 60),
    **{name: 15 for name in READERS if name.startswith('results_')},
}
SOAK_MUTATIONS = int(os.environ.get('FUZZ_MUTATIONS', '100000'))


@pytest.fixture(scope='module')
def results():
    return run_outside({name: FEWER.get(name, MUTATIONS) for name in READERS})


@pytest.mark.parametrize('name', READERS)
def test_a_damaged_file_is_read_or_refused_in_one_error(results, name):
    check(results[name], FEWER.get(name, MUTATIONS))


@pytest.mark.slow
@pytest.mark.timeout(36_000)
@pytest.mark.parametrize('name', READERS)
def test_a_hundred_thousand_damaged_files(name):
    check(run_outside({name: SOAK_MUTATIONS})[name], SOAK_MUTATIONS)


def check(found, count):
    assert 'died' not in found, (found['died'], found['said'])
    assert found['failures'] == []
    assert found['count'] == count
    assert found['megabytes'] * 1e6 <= MOST_BYTES
