"""Generated families repeat by their seed, have hard pairs with paths, and scale."""

import numpy as np
import pytest
from llm_astar_lab.datasets import generate as families
from llm_astar_lab.datasets.generate import (
    DEFAULT_SIDE,
    FAMILIES,
    GenerationError,
    floor,
    generate_family,
)
from llm_astar_lab.datasets.named import DrawRules, draw_family
from llm_astar_msgs_adapter.maps.problem_maps import load_maps, save_maps
from llm_astar_planner.cli import main as cli
from llm_astar_planner.planning.planner import Planner
from llm_astar_planner.planning.types import PlanRequest
from llm_astar_planner.search.any_angle import LineOfSightChecker
from scipy import ndimage


@pytest.mark.parametrize('family', FAMILIES)
def test_the_same_seed_makes_the_same_maps_however_many_follow(family):
    few, more = (list(generate_family(family, 3, maps, 4)) for maps in (2, 3))
    assert more[:2] == few
    assert {item.family for item in few} == {family}
    assert few[0].grid_map.digest != few[1].grid_map.digest
    assert next(generate_family(family, 4, 1, 4)).grid_map.digest != few[0].grid_map.digest


@pytest.mark.parametrize('family', FAMILIES)
def test_pairs_have_a_path_but_no_free_straight_line(family):
    (problem,) = generate_family(family, 5, 1, 8)
    blocked = problem.to_grid().blocked()
    assert blocked.shape == (DEFAULT_SIDE, DEFAULT_SIDE)
    assert len({sample[:2] for sample in problem.samples}) == 8
    starts, goals, _ = zip(*problem.samples)
    assert not LineOfSightChecker(blocked).clear(starts, goals).any()
    planner = Planner(problem.to_grid())
    for start, goal in zip(starts, goals):
        assert planner.plan(PlanRequest(start, goal, 'exact_astar')).code == 0


def test_every_room_of_a_floor_plan_can_be_reached():
    for seed in range(20):
        blocked = floor(DEFAULT_SIDE, np.random.default_rng(seed))
        assert ndimage.label(~blocked)[1] == 1
        assert 0.1 < blocked.mean() < 0.3


def test_a_finer_map_has_each_cell_of_the_plan_in_parts():
    (coarse,), (fine,) = (draw_family('rooms', DrawRules(1, 1, 3), scale) for scale in (1, 3))
    assert np.array_equal(fine.grid_map.cells[1::3, 2::3], coarse.grid_map.cells)
    assert fine.grid_map.resolution == pytest.approx(coarse.grid_map.resolution / 3)
    for sample, finer in zip(coarse.samples, fine.samples):
        assert (finer.start[0] // 3, finer.start[1] // 3) == sample.start
    (barriers,) = draw_family('barriers', DrawRules(1, 1, 3), 2)
    assert (barriers.range_x, barriers.family) == ((0, 102), 'barriers')


def test_families_are_kept_in_files(tmp_path):
    maps = [
        *draw_family('barriers', DrawRules(1, 1, 2)),
        *draw_family('mazes', DrawRules(1, 1, 2)),
    ]
    save_maps([maps[0], maps[1]], tmp_path / 'one_id.json')
    with pytest.raises(ValueError, match=r'index 1: id: 0 is used twice'):
        load_maps(tmp_path / 'one_id.json')
    save_maps(maps[:1], tmp_path / 'barriers.json')
    assert load_maps(tmp_path / 'barriers.json') == maps[:1]
    save_maps(maps[1:], tmp_path / 'mazes.json')
    (again,) = load_maps(tmp_path / 'mazes.json')
    assert (again, again.family) == (maps[1], 'mazes')


def test_what_cannot_be_drawn_is_refused(monkeypatch):
    for name, value in (('GRID_TRIES', 2), ('DRAWS_PER_PAIR', 1)):
        monkeypatch.setattr(families, name, value)
    with pytest.raises(GenerationError, match='ask for fewer'):
        next(generate_family('mazes', 0, 1, 400, side=41))
    for rules, scale in (
        (DrawRules(maps=0), 1),
        (DrawRules(maps=20_000), 1),
        (DrawRules(maps=1, pairs=1001), 1),
        (DrawRules(), 1000),
    ):
        with pytest.raises(GenerationError, match='--maps'):
            draw_family('floors', rules, scale)


def test_the_command_writes_a_family_that_others_read(tmp_path, capsys):
    file = str(tmp_path / 'floors.json')
    words = ('--family', 'floors', '--maps', '2', '--pairs', '3', '--scale', '2')
    assert cli.main(['dataset', 'generate', *words, '--out', file]) == 0
    assert [item.family for item in load_maps(file)] == ['floors', 'floors']
    plan = ('plan', '--map', file, '--map-id', '1', '--pair', '2', '--source', 'none')
    assert cli.main([*plan, '--method', 'exact_astar']) == 0
    assert 'path found' in capsys.readouterr().out
    assert cli.main(['dataset', 'generate', *words, '--size', '9', '9', '--out', file]) == 2
    assert '--scale makes floors larger' in capsys.readouterr().err
    assert cli.main(['dataset', 'generate', *words, '--seed', '-1', '--out', file]) == 2
