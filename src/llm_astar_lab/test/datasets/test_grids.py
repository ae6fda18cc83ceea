"""Grid datasets: MovingAI scenarios and map_server maps are loaded and benchmarked."""

import csv
import json
import math
import os
from pathlib import Path

import numpy as np
import pytest
from llm_astar_lab.analysis.thresholds import agrees, compare_with_reference
from llm_astar_lab.datasets.named import load_samples
from llm_astar_lab.results.row import Row
from llm_astar_lab.runner.sources import check_grid_options
from llm_astar_msgs_adapter.maps.grid_dataset import (
    GridProblem,
    GridProblemError,
    parse_grid_problem,
)
from llm_astar_msgs_adapter.maps.grid_map import GridMap
from llm_astar_msgs_adapter.maps.problem_maps import draw_pairs, load_grid_problem, load_kept_maps
from llm_astar_planner.cli import main as cli
from llm_astar_planner.costmap.costmap import Costmap
from llm_astar_planner.parameter import problem_of
from llm_astar_planner.waypoints.baselines import baseline_sources
from llm_astar_planner.waypoints.source import SourceStatus, WaypointQuery
from PIL import Image

# Row 0 first. No path is shorter by a diagonal move: each would cut a corner.
ROWS = ('.....', '.@@@.', '...@.', '.T.@.', '.....')
PAIRS = (((0, 0), (4, 4), 8.0), ((0, 0), (2, 2), 4.0), ((2, 2), (4, 4), 4.0))


def write_movingai(folder, rows=ROWS, pairs=PAIRS, name='x.map'):
    """Write a map and its scenarios; return the scenario file."""
    height, width = len(rows), len(rows[0])
    head = f'type octile\nheight {height}\nwidth {width}\nmap\n'
    (folder / name).write_text(head + '\n'.join(rows) + '\n')
    lines = [
        f'0\t{name}\t{width}\t{height}\t{start[0]}\t{start[1]}\t{goal[0]}\t{goal[1]}\t{length}'
        for start, goal, length in pairs
    ]
    path = folder / f'{name}.scen'
    path.write_text('\n'.join(['version 1', *lines]) + '\n')
    return path


def write_map_server(folder, pixels):
    """Write an image and its yaml; return the yaml."""
    Image.fromarray(np.array(pixels, dtype=np.uint8)).save(folder / 'x.pgm')
    path = folder / 'x.yaml'
    path.write_text(
        'image: x.pgm\nresolution: 0.5\norigin: [-1, -2, 0]\n'
        'occupied_thresh: 0.65\nfree_thresh: 0.25\nnegate: 0\n'
    )
    return path


def bench(dataset, out, *words):
    """Run the benchmark in this process and return its exit code."""
    return cli.main(['bench', '--map', str(dataset), '--out', str(out), *map(str, words)])


def row(method='astar', pair=0, **values):
    return Row(0, pair, 1, method, 'none', '', '', values.pop('code', 'NONE'), **values)


def test_the_rows_of_a_scenario_file_are_the_pairs_of_map_0(tmp_path):
    samples = load_samples(write_movingai(tmp_path))
    assert [sample.key for sample in samples] == [(0, 0), (0, 1), (0, 2)]
    assert samples[1].sample[:2] == ((0, 0), (2, 2))
    problem = load_grid_problem(tmp_path / 'x.map.scen')
    assert problem.optimal_lengths == (8.0, 4.0, 4.0)
    assert problem.to_grid().cells[1, 2] == 100
    assert len(load_samples(tmp_path / 'x.map.scen', limit=2)) == 2


def test_bench_compares_lengths_with_the_optimal_ones_and_reports(tmp_path, capsys):
    dataset, out = write_movingai(tmp_path), tmp_path / 'out'
    assert bench(dataset, out, '--json') == 0
    printed = capsys.readouterr()
    summary = json.loads(printed.out)
    sources = {case['source'] for case in summary['cases']}
    assert sources == {'none', 'embedded', 'embedded-best-of-8', 'coarse', 'straight', 'random'}
    assert 'exact_astar/none: 3 of 3 rows agree' in printed.err
    assert 'astar/none: 3 of 3 rows agree' in printed.err
    for name in ('results.csv', 'summary.json', 'report.md'):
        assert (out / name).is_file()
    assert 'data:image/png;base64' in (out / 'report.html').read_text()
    # Without the dataset: the maps are in the results folder.
    (tmp_path / 'x.map').unlink()
    dataset.unlink()
    assert cli.main(['report', str(out)]) == 0


def test_a_length_that_is_not_the_optimal_one_is_named_and_incomplete(tmp_path, capsys):
    wrong = [*PAIRS[:1], (*PAIRS[1][:2], 3.41), *PAIRS[2:]]
    dataset = write_movingai(tmp_path, pairs=wrong)
    assert bench(dataset, tmp_path / 'out', '--methods', 'exact_astar') == 3
    error = capsys.readouterr().err
    assert 'exact_astar/none: 2 of 3 rows agree' in error
    assert 'map 0, pair 1, length 4.000000, in the dataset 3.41' in error


def test_a_run_is_resumed_but_not_on_another_map(tmp_path, capsys):
    dataset, out = write_movingai(tmp_path), tmp_path / 'out'
    words = ('--methods', 'astar', '--resume')
    assert bench(dataset, out, *words, '--limit', '1') == 0
    assert bench(dataset, out, *words) == 0
    assert len((out / 'results.csv').read_text().splitlines()) == 4
    write_movingai(tmp_path, rows=(*ROWS[:3], '.....', '.....'))
    capsys.readouterr()
    assert bench(dataset, out, *words) == 2
    assert 'grid' in capsys.readouterr().err


@pytest.mark.parametrize(
    ('words', 'error'),
    [
        (('--scales', '1-9000'), 'scale: 9000 gives map 0 over'),
        (('--map-ids', '3'), '--map-ids 3'),
        (('--heuristic', 'manhattan', '--methods', 'astar'), None),
    ],
)
def test_options_that_do_not_fit_a_grid(tmp_path, capsys, words, error):
    code = bench(write_movingai(tmp_path), tmp_path / 'out', *words)
    printed = capsys.readouterr().err
    assert code == (0 if error is None else 2)
    # Manhattan overestimates, so the lengths of A* are not compared.
    assert 'agree' not in printed if error is None else error in printed


@pytest.mark.parametrize(
    ('rows', 'pairs', 'error'),
    [
        (ROWS, [((1, 1), (0, 0), 1.0)], r'row 0: start: \(1, 1\) is blocked'),
        (ROWS, [*PAIRS, ((0, 0), (1, 3), 1.0)], r'row 3: goal: \(1, 3\) is blocked'),
    ],
)
def test_a_scenario_that_does_not_fit_its_map_is_named(tmp_path, rows, pairs, error):
    with pytest.raises(GridProblemError, match=error):
        load_samples(write_movingai(tmp_path, rows, pairs))


def test_bad_files_are_reported_in_one_line(tmp_path, capsys):
    dataset = write_movingai(tmp_path)
    assert bench(tmp_path / 'x.map', tmp_path / 'out') == 2
    assert 'name its scenario file' in capsys.readouterr().err
    dataset.write_text(dataset.read_text().replace('x.map\t5\t5', 'x.map\t6\t5'))
    assert bench(dataset, tmp_path / 'out') == 2
    assert 'row 0: width, height: the map has 5 x 5 cells, not 6 x 5' in capsys.readouterr().err
    (tmp_path / 'x.map').unlink()
    assert bench(dataset, tmp_path / 'out') == 2
    assert 'no such file' in capsys.readouterr().err


def test_pairs_of_a_yaml_map_are_free_and_connected(tmp_path, capsys):
    # Two rooms, one cell connected with nothing, and unknown cells.
    pixels = np.full((8, 9), 254)
    pixels[:, 4] = 0
    pixels[0, 5:] = pixels[2, 5:] = 0
    pixels[1, 5:8] = 0
    pixels[3:, 8] = 205
    dataset = write_map_server(tmp_path, pixels)
    problem = load_grid_problem(dataset)
    assert len(problem.samples) == 100
    cells = problem.to_grid().cells
    for start, goal, _ in problem.samples:
        assert start != goal
        assert (start[0] < 4) == (goal[0] < 4)
        assert cells[start[1], start[0]] == cells[goal[1], goal[0]] == 0
    assert draw_pairs(problem.grid_map, 5, 0) == problem.samples[:5]
    assert draw_pairs(problem.grid_map, 5, 1) != problem.samples[:5]
    assert bench(dataset, tmp_path / 'out', '--limit', '4', '--methods', 'exact_astar') == 0
    assert 'agree' not in capsys.readouterr().err
    with (tmp_path / 'out' / 'results.csv').open() as file:
        codes = [found['code'] for found in csv.DictReader(file)]
    assert codes == ['NONE'] * 8


def test_a_map_without_two_connected_cells_is_refused(tmp_path):
    with pytest.raises(GridProblemError, match='no two of its free cells'):
        load_grid_problem(write_map_server(tmp_path, [[254, 0], [0, 254]]))


def test_diagonals_need_both_adjacent_cells_free(tmp_path):
    dataset = write_movingai(tmp_path, ('.@.', '...', '...'), [((0, 0), (2, 0), 4.0)])
    assert bench(dataset, tmp_path / 'out', '--methods', 'exact_astar') == 0


def test_a_published_length_of_zero_between_two_cells_is_none(tmp_path, capsys):
    pairs = [((0, 0), (4, 4), 0.0), ((0, 0), (0, 0), 0.0), ((0, 0), (2, 2), 4.0)]
    dataset = write_movingai(tmp_path, pairs=pairs)
    assert np.isnan(load_grid_problem(dataset).optimal_lengths).tolist() == [True, False, False]
    assert bench(dataset, tmp_path / 'out', '--methods', 'exact_astar') == 0
    assert 'exact_astar/none: 2 of 2 rows agree' in capsys.readouterr().err


def test_a_length_agrees_up_to_its_printed_digits():
    assert agrees(10.895, 10.9)
    assert agrees(4000.0085, 4000.0)
    assert not agrees(10.88, 10.9)
    assert not agrees(math.nan, 10.9)


def test_only_exact_methods_are_compared_with_the_reference():
    rows = [row(length=2.0), row('weighted_astar', length=9.0), row('astar', 1, code='TIMEOUT')]
    (found,) = compare_with_reference(rows, {(0, 0): 2.0, (0, 1): 5.0}, 'octile')
    assert (found.rows, found.agreeing) == (2, 1)
    assert found.first == 'map 0, pair 1, TIMEOUT, in the dataset 5'
    assert compare_with_reference(rows, {(0, 0): 2.0}, 'manhattan') == []
    assert compare_with_reference(rows, {}, 'euclidean') == []


def test_a_grid_problem_is_read_back_unchanged(tmp_path):
    problem = load_grid_problem(write_movingai(tmp_path))
    again = parse_grid_problem(json.loads(json.dumps(problem.to_json())))
    assert again == problem
    assert hash(again) == hash(problem)
    assert again != GridProblem(0, problem.grid_map)
    assert problem.scale(1) is problem


@pytest.mark.parametrize(
    ('change', 'error'),
    [
        ({'cells': 'no base64!'}, 'cells: '),
        ({'width': 7}, 'reshape'),
        ({'start_goal': [[[0], [1, 2]]]}, 'maps.json: map at index 0'),
        ({'optimal_lengths': None}, 'maps.json: map at index 0'),
        ({'origin': [math.inf, 0, 0]}, 'origin'),
    ],
)
def test_a_damaged_map_of_a_results_folder_is_named(tmp_path, change, error):
    entry = load_grid_problem(write_movingai(tmp_path)).to_json()
    (tmp_path / 'maps.json').write_text(json.dumps([entry | change]))
    with pytest.raises(GridProblemError, match=error):
        load_kept_maps(tmp_path / 'maps.json')


def test_sources_that_need_a_visibility_graph_are_refused_on_large_maps():
    cells = np.zeros((120, 120), dtype=np.int8)
    cells[1::3, 1::3] = 100
    large, small = GridProblem(0, GridMap(cells)), GridProblem(0, GridMap(cells[:20, :20]))
    check_grid_options(small, ['oracle'])
    check_grid_options(large, ['straight', 'none'])
    with pytest.raises(ValueError, match=r'--source oracle: the map has .* corners'):
        check_grid_options(large, ['oracle', 'straight'])
    for name in ('oracle', 'noisy', 'reversed'):
        reply = baseline_sources()[name].waypoints(
            WaypointQuery(Costmap(large.to_grid()), (0, 0), (9, 5))
        )
        assert reply.status is SourceStatus.ERROR
        assert 'corners' in reply.detail


def test_plan_takes_a_movingai_map_without_its_scenarios(tmp_path, capsys):
    map_file = str(write_movingai(tmp_path)).removesuffix('.scen')
    assert cli.main(['plan', '--map', map_file]) == 2
    assert 'map 0 has 0 pairs; give --start and --goal' in capsys.readouterr().err
    ends = ('--start', '0', '0', '--goal', '1', '0')
    assert cli.main(['plan', '--map', map_file, '--source', 'none', *ends]) == 0
    assert capsys.readouterr().out.startswith('path found: 1.00 cells, ')


def test_plan_takes_a_grid_in_cells(tmp_path, capsys):
    dataset = write_movingai(tmp_path)
    words = ('plan', '--map', str(dataset), '--method', 'exact_astar', '--json')
    assert cli.main([*words, '--pair', '1']) == 0
    assert json.loads(capsys.readouterr().out)['length'] == 4.0
    yaml = write_map_server(tmp_path, [[254, 0, 254], [254, 254, 254]])
    ends = ('--cells', '--start', '0', '0', '--goal', '2', '1', '--map', str(yaml))
    assert cli.main([*words, *ends]) == 0
    plan = json.loads(capsys.readouterr().out)
    # Row 0 of the grid is the picture's last row; the path goes below the blocked cell.
    assert plan['path'] == [[0, 0], [1, 0], [2, 0], [2, 1]]
    assert cli.main([*words, '--map-id', '4']) == 2
    assert 'map id 4' in capsys.readouterr().err


def test_map_node_publishes_a_map_server_map_too(tmp_path):
    map_node = pytest.importorskip('llm_astar_planner.nodes.map_node')
    path = write_map_server(tmp_path, [[254, 0], [254, 254]])
    values = {'map_file': str(path), 'map_id': 7, 'resolution': 3.0, 'frame_id': 'floor'}
    grid_map = map_node.load_grid(values)
    assert (grid_map.resolution, grid_map.frame_id, grid_map.origin.x) == (0.5, 'floor', -1.0)
    assert grid_map.cells.tolist() == [[0, 0], [0, 100]]
    (tmp_path / 'x.pgm').unlink()
    problem = problem_of(map_node.load_grid, values)
    assert 'x.yaml: image: ' in problem
    assert '\n' not in problem


@pytest.mark.skipif('LLM_ASTAR_REFERENCE' not in os.environ, reason='LLM_ASTAR_REFERENCE unset')
def test_every_movingai_row_agrees(tmp_path, capsys):
    folder = Path(os.environ['LLM_ASTAR_REFERENCE']) / 'grids'
    pairs = {}
    with (folder / 'scenarios.csv').open() as file:
        for entry in csv.DictReader(file):
            ends = [(int(entry[f'{end}_x']), int(entry[f'{end}_y'])) for end in ('start', 'goal')]
            pairs.setdefault(entry['map'], []).append((*ends, entry['optimal_length']))
    assert sum(map(len, pairs.values())) == 120
    for name, of_map in pairs.items():
        rows = (folder / f'{name}.map').read_text().splitlines()[4:]
        dataset = write_movingai(tmp_path, rows, of_map, f'{name}.map')
        assert bench(dataset, tmp_path / name, '--methods', 'exact_astar,astar') == 0
        printed = capsys.readouterr().err
        for method in ('astar', 'exact_astar'):
            assert f' {method}/none: {len(of_map)} of {len(of_map)} rows agree' in printed
