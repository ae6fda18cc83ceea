"""Maps of benchmarks for language models: read as their authors write them, or refused."""

import json

import pytest
from llm_astar_msgs_adapter.maps.barrier_map import Sample
from llm_astar_msgs_adapter.maps.problem_maps import load_maps

from benchmarks.llm_maps import LlmBenchmarkError, load_llm_benchmark, main

GTB = {
    'walkable_tiles': "['a', 'b']",
    'environment': 'aaka\nab@a\naak',
    # An objective may stand on a tile that is none to walk on, and outside of the map.
    'objectives': {'first': ['a', 0, 0], 'river': ['k', 2, 2], 'nowhere': ['a', 9, 9]},
}
PPNL = {'world': [[0, 1, 3], [2, 1, 0], [0, 0, 0]]}
GRIDROUTE = (
    '\ufeffmatrix_size,obstacles,all_obstacle_coords,start_x,start_y,end_x,end_y\n'
    '4,[],"[(2, 0), (2, 1)]",0,0,3,1\n4,[],"[(2, 0), (2, 1)]",1,0,0,3\n4,[],"[]",1,1,2,2\n'
)


def write(folder, contents):
    path = folder / 'file'
    path.write_text(contents if isinstance(contents, str) else json.dumps(contents))
    return path


def blocked(problem):
    return problem.grid_map.blocked().astype(int).tolist()


def test_a_character_walks_from_objective_to_objective(tmp_path):
    (problem,) = load_llm_benchmark('gtb', write(tmp_path, [GTB]))
    assert blocked(problem) == [[0, 0, 1, 0], [0, 0, 0, 0], [0, 0, 0, 1]]
    assert problem.samples == (Sample((2, 1), (0, 0)), Sample((0, 0), (2, 2)))
    assert problem.family == 'gtb'


def test_a_world_has_one_start_and_one_goal(tmp_path):
    (problem,) = load_llm_benchmark('ppnl', write(tmp_path, [PPNL]))
    assert blocked(problem) == [[0, 1, 0], [0, 1, 0], [0, 0, 0]]
    assert problem.samples == (Sample((0, 1), (2, 0)),)


def test_rows_on_one_map_are_samples_of_one_map(tmp_path):
    first, second = load_llm_benchmark('gridroute', write(tmp_path, GRIDROUTE))
    assert blocked(first) == [[0, 0, 1, 0], [0, 0, 1, 0], [0, 0, 0, 0], [0, 0, 0, 0]]
    assert first.samples == (Sample((0, 0), (3, 1)), Sample((1, 0), (0, 3)))
    assert (second.id, second.samples) == (1, (Sample((1, 1), (2, 2)),))


def test_they_are_written_as_a_dataset(tmp_path, capsys):
    out = tmp_path / 'maps' / 'ppnl.json'
    assert main(['ppnl', str(write(tmp_path, [PPNL, PPNL])), str(out)]) == 0
    assert capsys.readouterr().out.endswith(': 1 maps, 2 samples\n')
    (problem,) = load_maps(out)
    assert (problem.family, len(problem.samples)) == ('ppnl', 2)


@pytest.mark.parametrize(
    ('name', 'contents'),
    [
        ('gtb', [{**GTB, 'environment': 'aaa'}]),
        ('gtb', [{'environment': 3}]),
        ('gtb', {}),
        ('ppnl', [{'world': [[0, 1], [2, 3, 0]]}]),
        ('ppnl', [{'world': [[0, 1, 2]]}]),
        ('ppnl', [7]),
        ('gridroute', GRIDROUTE.replace('4,[]', '999999999,[]', 1)),
        ('gridroute', GRIDROUTE.replace('3,1\n', '3,7\n', 1)),
        ('gridroute', 'a,b\n1,2\n'),
        ('gridroute', ''),
    ],
)
def test_a_file_that_is_none_of_theirs_is_refused_by_its_name(tmp_path, name, contents):
    path = write(tmp_path, contents)
    with pytest.raises(LlmBenchmarkError, match=str(path)):
        load_llm_benchmark(name, path)
