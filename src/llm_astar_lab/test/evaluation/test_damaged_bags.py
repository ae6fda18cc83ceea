"""Damaged bags: whatever bytes are wrong, the rest is read and the problem is said."""

import random

import pytest
from bag_makers import as_sqlite3
from llm_astar_lab.bags.reading import Bag
from llm_astar_lab.bags.storage import BagError
from llm_astar_lab.evaluation.requests import RequestReader, TopicSelection
from llm_astar_planner.cli.main import main
from llm_astar_planner.resources import find_file

MUTATIONS = 100
ENDINGS = {'mcap': '.mcap', 'sqlite3': '.db3'}


def mutated(data, rng):
    """Return data with a few bits flipped, a part overwritten by another, or its end cut off."""
    changed = bytearray(data)
    kind = rng.choice(['bit', 'bit', 'bits', 'bytes', 'copy', 'cut'])
    place = rng.randrange(len(data))
    if kind in ('bit', 'bits'):
        for _ in range(3 if kind == 'bits' else 1):
            changed[rng.randrange(len(data))] ^= 1 << rng.randrange(8)
    elif kind == 'bytes':
        changed[place : place + 8] = b'\xff' * len(changed[place : place + 8])
    elif kind == 'copy':
        other = rng.randrange(len(data) - 200)
        part = changed[place : place + rng.randrange(1, 200)]
        changed[other : other + len(part)] = part
    else:
        del changed[place:]
    return bytes(changed)


def read_requests(path):
    """Return how many requests a bag has, and what is said of what is left out."""
    with Bag(path) as bag:
        count = sum(1 for _ in RequestReader(bag, TopicSelection(), 1.0).requests())
        return count, bag.problems.lines()


@pytest.mark.parametrize('storage', ENDINGS)
def test_no_damage_ends_in_a_traceback(storage, tmp_path):
    whole = tmp_path / 'whole'
    dataset = str(find_file('samples_1000.json', 'maps'))
    arguments = ['--map', dataset, '--map-ids', '50', '--out', str(whole)]
    assert main(['dataset', 'to-bag', *arguments]) == 0
    if storage == 'sqlite3':
        whole = as_sqlite3(whole, tmp_path / storage)
    data = next(whole.glob(f'*{ENDINGS[storage]}')).read_bytes()
    path = tmp_path / f'broken{ENDINGS[storage]}'
    rng = random.Random(1)  # noqa: S311 - no secret
    fewer = 0
    for _ in range(MUTATIONS):
        path.write_bytes(mutated(data, rng))
        try:
            count, lines = read_requests(path)
        except BagError as error:
            assert str(path) in str(error)
            fewer += 1
            continue
        assert count <= 10
        if count < 10:
            assert lines
            fewer += 1
    assert fewer > MUTATIONS // 10
