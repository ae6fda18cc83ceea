"""Generated datasets obey the recipe."""

import pytest
from llm_astar_lab.datasets.generate import (
    GenerationError,
    MapRules,
    detour,
    generate,
    query_sentence,
)
from llm_astar_msgs_adapter.maps.barrier_map import (
    Barrier,
    BarrierMap,
    load_barrier_maps,
)
from llm_astar_planner.search.any_angle import LineOfSightChecker


@pytest.fixture(scope='module')
def maps():
    return list(generate(seed=3, maps=6))


def test_the_same_seed_makes_the_same_maps_however_many_follow(maps):
    assert list(generate(seed=3, maps=2)) == maps[:2]
    assert next(generate(seed=4, maps=1)) != maps[0]


def test_maps_follow_the_recipe(maps):
    for barrier_map in maps:
        assert (barrier_map.range_x, barrier_map.range_y) == ((0, 51), (0, 31))
        assert 1 <= len(barrier_map.horizontal_barriers) <= 4
        assert 1 <= len(barrier_map.vertical_barriers) <= 4
        assert len({sample[:2] for sample in barrier_map.samples}) == 10
        assert detour(barrier_map) >= MapRules().min_detour


def test_straight_lines_are_blocked(maps):
    for barrier_map in maps:
        line_of_sight = LineOfSightChecker(barrier_map.to_grid().blocked())
        starts, goals, _ = zip(*barrier_map.samples)
        assert not line_of_sight.clear(starts, goals).any()


def test_the_query_is_the_sentence_of_the_dataset():
    barrier_map = BarrierMap(0, (0, 51), (0, 31), (Barrier(10, 0, 25),), (Barrier(25, 10, 22),))
    assert query_sentence(barrier_map, (5, 5), (20, 20)) == (
        'design a path from [5, 5] to [20, 20] on a 51 by 31 grid that avoids horizontal '
        'barriers centered at [[10, 0, 25]] and vertical barriers at [[25, 10, 22]].'
    )


def test_rules_that_no_map_can_meet_are_refused(monkeypatch):
    monkeypatch.setattr('llm_astar_lab.datasets.generate.TRIES', 3)
    with pytest.raises(GenerationError, match='map 0: none of 3 random maps'):
        list(generate(0, 1, MapRules(min_detour=50.0)))
    with pytest.raises(GenerationError, match='size'):
        list(generate(0, 1, MapRules(size=(4, 4))))


def test_the_shipped_samples_are_those_of_the_command(request):
    shipped = load_barrier_maps(request.config.rootpath / 'maps' / 'samples_1000.json')
    assert (len(shipped), sum(len(m.samples) for m in shipped)) == (100, 1000)
    assert shipped[:3] == list(generate(seed=0, maps=3))
