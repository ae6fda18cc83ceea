"""Damaged files and texts: every reader reads them or says in one error what is wrong with them.

`make soak` reads 100,000 mutations for each reader.
"""

import os

import pytest
from fuzz_readers import READERS
from fuzzing import MOST_BYTES, run_outside

# The time of the whole module counts as that of its first test.
pytestmark = pytest.mark.timeout(900)
MUTATIONS = 300
# A folder of results is summed up and reported anew for each mutation, which takes a tenth of a
# second and more.
FOLDERS = [name for name in READERS if name.startswith('results_')]
FOLDER_MUTATIONS = 60
SOAK_MUTATIONS = int(os.environ.get('FUZZ_MUTATIONS', '100000'))


@pytest.fixture(scope='module')
def results():
    files = [name for name in READERS if name not in FOLDERS]
    return run_outside(MUTATIONS, files) | run_outside(FOLDER_MUTATIONS, FOLDERS)


@pytest.mark.parametrize('name', READERS)
def test_a_damaged_file_is_read_or_refused_in_one_error(results, name):
    check(results[name], FOLDER_MUTATIONS if name in FOLDERS else MUTATIONS)


@pytest.mark.slow
@pytest.mark.timeout(36_000)
@pytest.mark.parametrize('name', READERS)
def test_a_hundred_thousand_damaged_files(name):
    check(run_outside(SOAK_MUTATIONS, [name])[name], SOAK_MUTATIONS)


def check(found, count):
    assert 'died' not in found, (found['died'], found['said'])
    assert found['failures'] == []
    assert found['count'] == count
    assert found['megabytes'] * 1e6 <= MOST_BYTES
