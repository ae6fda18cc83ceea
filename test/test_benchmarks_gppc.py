"""The competition's figures: lengths as published, other planners as programs, memory apart."""

import json
import sys
import tracemalloc

import numpy as np
import pytest
from llm_astar_lab.datasets.generate import generate_family

from benchmarks import gppc

ROWS = ('......', '..@@..', '......', '.@....')
# Rows of a scenario file: start, goal and the length that MovingAI publishes.
PAIRS = [((0, 0), (5, 0), 5.0), ((1, 0), (4, 2), 5.0), ((0, 3), (5, 3), 6.414213)]
PEER = """
import sys
rows = [line.split() for line in open(sys.argv[2])][1:]
print('preparation 2.5')
print('storage 1000000')
for row in rows:
    print(float(row[-1]) * 1.04, 250)
"""


@pytest.fixture
def sets(tmp_path):
    for part in ('map', 'scen'):
        (tmp_path / f'dao-{part}').mkdir()
    head = f'type octile\nheight {len(ROWS)}\nwidth 6\nmap\n'
    (tmp_path / 'dao-map/x.map').write_text(head + '\n'.join(ROWS) + '\n')
    write_rows(tmp_path, PAIRS)
    return tmp_path


def write_rows(folder, pairs):
    lines = [f'0\tx.map\t6\t4\t{a}\t{b}\t{c}\t{d}\t{length}' for (a, b), (c, d), length in pairs]
    (folder / 'dao-scen/x.map.scen').write_text('\n'.join(['version 1', *lines]) + '\n')


def run(folder, *words):
    code = gppc.main(
        ['--maps', str(folder), '--out', str(folder / 'out'), '--rounds', '2', *words]
    )
    return code, json.loads((folder / 'out/gppc.json').read_text())['dao']


def test_every_length_is_compared_with_the_published_one(sets, capsys):
    code, found = run(sets)
    assert code == 0
    assert {figures['as_published'] for figures in found.values()} == {3}
    assert found['guided']['held_mb'] > found['exact_astar']['held_mb'] > 0
    assert '| dao | exact_astar | 3 | 3 |' in capsys.readouterr().out


def test_a_length_that_differs_is_named_and_ends_with_3(sets):
    write_rows(sets, [*PAIRS[:2], ((0, 3), (5, 3), 6.0)])
    code, found = run(sets, '--methods', 'exact_astar')
    assert code == 3
    assert 'x.map (0, 3) to (5, 3): 6.414214, published 6.0' in found['exact_astar']['wrong'][0]


def test_another_planner_takes_part_as_a_program(sets):
    (sets / 'peer.py').write_text(PEER)
    peer = f'theirs={sys.executable} {sets / "peer.py"}'
    _, found = run(sets, '--methods', 'exact_astar', '--peer', peer)
    theirs = found['theirs']
    assert (theirs['mean_ms'], theirs['preparation_ms'], theirs['held_mb']) == (0.25, 2.5, 1.0)
    assert theirs['shares'] == [0, 0, 1, 0, 0, 0]
    assert theirs['suboptimality'] == pytest.approx(1.04)


def test_a_program_that_answers_too_little_is_named(sets):
    with pytest.raises(SystemExit, match='0 answers to 3 rows'):
        run(sets, '--methods', 'exact_astar', '--peer', f'none={sys.executable} -c pass')


def test_a_folder_without_the_set_is_named(tmp_path):
    with pytest.raises(SystemExit, match='has no scenarios of dao'):
        run(tmp_path)


def test_arrays_are_counted_once_with_what_their_views_hold():
    class Holder:
        def __init__(self):
            self.whole = np.zeros(1000, dtype=np.int32)
            self.parts = {'a': self.whole[:10], 'again': [self]}
            self.other = np.zeros((10, 10))[::2]

    assert gppc.held_bytes(Holder()) == 4000 + 800
    assert gppc.held_bytes(lambda: Holder) == 0


def test_the_memory_of_a_planner_is_about_what_python_says_it_takes():
    (problem,) = generate_family('rooms', 0, 1, 1, side=401)
    start, goal, _ = problem.samples[0]
    gppc.prepare_planner(problem.grid_map, 1.0).plan(start, goal)  # what the first of all loads
    tracemalloc.start()
    prepared = gppc.prepare_planner(problem.grid_map, 1.0)
    prepared.plan(start, goal)
    held, _ = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    counted = gppc.held_bytes(prepared.holder) - problem.grid_map.cells.nbytes
    assert 0.8 * held < counted < 1.2 * held
