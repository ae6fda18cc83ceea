"""Datasets by name: the paper's file, MovingAI's sets in a folder, generated families."""

import csv
import json
import shutil

import pytest
from llm_astar_lab.datasets import named
from llm_astar_lab.datasets.named import (
    NAMES,
    DrawRules,
    SelectionError,
    load_named,
    parse_names,
)
from llm_astar_msgs_adapter.maps.grid_dataset import GridProblemError
from llm_astar_planner.cli import main as cli
from reader_files import write_movingai


def bench(out, *words):
    """Run the fastest benchmark of some options and return its exit code."""
    quick = ('--methods', 'exact_astar', '--source', 'none', '--out')
    return cli.main(['bench', *map(str, (*words, *quick, out))])


def rows_of(out):
    with (out / 'results.csv').open() as file:
        return list(csv.DictReader(file))


def make_set(folder, name='dao', maps=('arena', 'den'), apart=True):
    """Write maps and scenarios as MovingAI's archives unpack, apart or in one folder."""
    places = [folder / f'{name}-{kind}' if apart else folder / name for kind in ('map', 'scen')]
    for place in (folder, *places):
        place.mkdir(exist_ok=True, parents=True)
    write_movingai(folder)
    for map_name in maps:
        shutil.copy(folder / 'x.map', places[0] / f'{map_name}.map')
        shutil.copy(folder / 'x.map.scen', places[1] / f'{map_name}.map.scen')
    (folder / 'x.map').unlink()
    (folder / 'x.map.scen').unlink()
    return folder


@pytest.mark.parametrize('apart', [True, False])
def test_a_set_is_found_in_folders_named_as_its_archives_unpack(tmp_path, apart):
    folder = make_set(tmp_path / 'sets', apart=apart)
    make_set(tmp_path / 'sets', 'street', ['Berlin'], apart)
    dataset = load_named(['movingai/dao'], folder, DrawRules())
    assert [item.id for item in dataset.maps] == [0, 1]
    assert {item.family for item in dataset.maps} == {'movingai/dao'}
    assert len(dataset.maps[1].samples) == len(dataset.maps[1].optimal_lengths) == 10
    both = load_named(['movingai/street', 'movingai/dao'], folder, DrawRules())
    sets = ['movingai/street', 'movingai/dao', 'movingai/dao']
    assert [(item.id, item.family) for item in both.maps] == list(enumerate(sets))


def test_a_folder_of_any_name_holds_the_set_that_is_asked_for(tmp_path):
    folder = make_set(tmp_path / 'sets', 'downloads')
    assert len(load_named(['movingai/dao'], folder, DrawRules()).maps) == 2
    folder.rename(tmp_path / 'maze')
    with pytest.raises(ValueError, match='has no folder of dao, but of maze'):
        load_named(['movingai/dao'], tmp_path / 'maze', DrawRules())


def test_links_to_folders_are_followed_once(tmp_path):
    folder = make_set(tmp_path / 'real')
    links = tmp_path / 'links'
    links.mkdir()
    for path in folder.iterdir():
        (links / path.name).symlink_to(path)
    (links / 'back').symlink_to(links)
    assert len(load_named(['movingai/dao'], links, DrawRules()).maps) == 2


def test_a_second_copy_of_a_scenario_is_refused(tmp_path):
    folder = make_set(tmp_path / 'set')
    scenario = next(folder.rglob('*.map.scen'))
    (scenario.parent / 'old').mkdir()
    (scenario.parent / 'old' / scenario.name).write_bytes(scenario.read_bytes())
    with pytest.raises(GridProblemError, match=rf'has several files {scenario.name}; remove all'):
        load_named(['movingai/dao'], folder, DrawRules())


def test_many_maps_are_run_at_once_and_lengths_are_compared_on_each(tmp_path, capsys):
    folder, out = make_set(tmp_path / 'sets'), tmp_path / 'out'
    assert bench(out, '--dataset', 'movingai/dao', '--path', folder, '--map-ids', '0-1') == 0
    assert 'exact_astar/none: 20 of 20 rows agree with the optimal' in capsys.readouterr().err
    rows = rows_of(out)
    assert {(row['map'], row['family']) for row in rows} == {
        ('0', 'movingai/dao'), ('1', 'movingai/dao'),
    }  # fmt: skip
    wrong = folder / 'dao-scen' / 'den.map.scen'
    wrong.write_text(wrong.read_text().replace('\t30\n', '\t31.5\n', 1))
    words = ('--dataset', 'movingai/dao', '--path', folder)
    assert bench(tmp_path / 'wrong', *words) == 3
    assert 'map 1, pair 0, length 30.000000, in the dataset 31.5' in capsys.readouterr().err
    # The folder holds another dataset now, so its rows are not mixed with the earlier ones.
    assert bench(out, *words, '--resume') == 2
    assert 'dataset' in capsys.readouterr().err


def test_missing_and_ambiguous_files_of_a_set_are_named(tmp_path, monkeypatch):
    folder = make_set(tmp_path / 'sets')
    (folder / 'dao-map' / 'more').mkdir()
    shutil.copy(folder / 'dao-map' / 'den.map', folder / 'dao-map' / 'more')
    with pytest.raises(ValueError, match=r'den.map.scen: map: several of them are'):
        load_named(['movingai/dao'], folder, DrawRules())
    shutil.rmtree(folder / 'dao-map')
    with pytest.raises(ValueError, match=r'arena.map.scen: map: it is not in'):
        load_named(['movingai/dao'], folder, DrawRules())
    shutil.rmtree(folder / 'dao-scen')
    with pytest.raises(ValueError, match='has no scenarios of dao'):
        load_named(['movingai/dao'], folder, DrawRules())
    make_set(tmp_path / 'sets')
    monkeypatch.setattr(named, 'MAX_ENTRIES', 2)
    with pytest.raises(ValueError, match='over 2 files'):
        load_named(['movingai/dao'], folder, DrawRules())


def test_families_are_run_together_and_at_larger_scales(tmp_path):
    out = tmp_path / 'out'
    words = ('--dataset', 'barriers,mazes', '--maps', 2, '--pairs', 2, '--seed', 4)
    assert bench(out, *words, '--scales', '1-2', '--scale-samples', 2) == 0
    rows = rows_of(out)
    assert {(row['map'], row['family']) for row in rows} == {
        ('0', 'barriers'), ('1', 'barriers'), ('2', 'mazes'), ('3', 'mazes'),
    }  # fmt: skip
    assert {row['scale'] for row in rows} == {'1', '2'}
    assert {row['code'] for row in rows} == {'NONE'}
    metadata = json.loads((out / 'metadata.json').read_text())
    assert metadata['dataset']['file'] == 'barriers, mazes'
    assert bench(out, *words, '--resume') == 0
    assert bench(out, *words[:-1], 5, '--resume') == 2


@pytest.mark.parametrize(
    ('words', 'part'),
    [
        (['--dataset', 'romos'], 'did you mean rooms?'),
        (['--dataset', 'rooms,x.json'], "'x.json' is unknown"),
        (['--dataset', 'movingai/dao'], 'needs --path'),
        (['--dataset', 'movingai/dao', '--path', 'nowhere'], 'is not a folder'),
        (['--dataset', 'rooms', '--maps', '0-9'], "'0-9' is not a whole number"),
        (['--dataset', 'rooms', '--maps', '0'], "'0' is not a whole number of at least 1"),
        (['--dataset', 'rooms', '--path', '.'], '--path: needs --dataset'),
        (['--dataset', 'rooms', '--map', 'x.json'], 'not allowed with'),
        (['--pairs', '3'], '--pairs: needs --dataset'),
        (['--dataset', 'gone.json'], 'a file is given with --map'),
    ],
)
def test_options_that_do_not_fit_are_named_in_one_line(tmp_path, capsys, words, part):
    try:
        code = bench(tmp_path / 'out', *words)
    except SystemExit as error:
        code = error.code
    assert code == 2
    printed = capsys.readouterr().err
    assert part in printed
    assert 'Traceback' not in printed
    assert not (tmp_path / 'out').exists()


def test_every_name_is_read_and_a_file_is_refused():
    assert parse_names(','.join(NAMES)) == NAMES
    with pytest.raises(SelectionError, match='a file is given with --map'):
        parse_names('maps/x.json')
    with pytest.raises(SelectionError, match=r'movingai/mazes.*did you mean movingai/maze'):
        parse_names('movingai/mazes')
