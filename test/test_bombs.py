"""Small files that ask for much memory or time are refused, or read within 300 MB."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest
from bombs import BOMBS
from fuzzing import MOST_SECONDS

READ = {
    'image of 4000 x 4000 pixels',
    'MovingAI rows of one cell',
    '20,000 barrier maps',
    # It is set aside.
    'last line of a transcript',
}
# What can be read of these bags is read, and the rest is said.
BAGS = {name for name in BOMBS if name.startswith(('mcap', 'database with a large'))}
pytestmark = pytest.mark.timeout(600)


@pytest.fixture(scope='module')
def outcomes():
    paths = os.pathsep.join(path for path in sys.path if path)
    ended = subprocess.run(
        [sys.executable, Path(__file__).with_name('bombs.py')],
        env=os.environ | {'PYTHONPATH': paths},
        capture_output=True,
        text=True,
    )
    assert ended.returncode == 0, ended.stderr
    return {item['name']: item for item in map(json.loads, ended.stdout.splitlines())}


@pytest.mark.parametrize('name', BOMBS)
def test_a_file_takes_no_more_memory_than_declared(outcomes, name):
    found = outcomes[name]
    assert 'died' not in found
    assert found['outcome'].startswith('read' if name in READ | BAGS else 'refused: '), found
    assert found['megabytes'] <= found['limit']
    assert found['seconds'] < MOST_SECONDS
