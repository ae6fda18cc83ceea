"""Retrieved examples: solved truly, the most similar ones, and never of the query's own map."""

import json
from dataclasses import replace
from itertools import islice, pairwise

import numpy as np
import pytest
from llm_astar_msgs_adapter.maps.barrier_map import (
    Barrier,
    BarrierMap,
    Sample,
    load_barrier_maps,
)
from llm_astar_msgs_adapter.maps.problem_maps import save_maps
from llm_astar_planner.costmap.costmap import Costmap
from llm_astar_planner.resources import find_file
from llm_astar_planner.waypoints.prompts.examples import (
    ExampleLibrary,
    ExamplesError,
    Prompt,
    is_same_map,
    load_example_library,
    occupied_tiles,
)
from llm_astar_planner.waypoints.prompts.map_description import describe
from llm_astar_planner.waypoints.prompts.template import load_template
from llm_astar_planner.waypoints.source import WaypointQuery
from segments import crosses

MAPS = load_barrier_maps(find_file('samples_1000.json', 'maps'))[:12]
# How many samples they have.
COUNT = sum(len(item.samples) for item in MAPS)


def query_of(barrier_map, pair=0, **changes):
    sample = barrier_map.samples[pair]
    query = WaypointQuery(Costmap(barrier_map.to_grid()), sample.start, sample.goal)
    return replace(query, **changes)


@pytest.fixture(scope='module')
def library():
    return ExampleLibrary(MAPS)


def test_an_example_is_a_path_round_the_barriers_that_it_names(library):
    solved = [found for index in range(COUNT) if (found := library.solve(index))]
    assert len(solved) > 0.8 * COUNT
    assert any(len(path) > 3 for _, path in solved)
    for description, path in solved:
        assert (path[0], path[-1]) == (description.start, description.goal)
        walls = [((b.first, b.line), (b.last, b.line)) for b in description.horizontal_barriers]
        walls += [((b.line, b.first), (b.line, b.last)) for b in description.vertical_barriers]
        assert not any(crosses(p, q, *wall) for p, q in pairwise(path) for wall in walls)
        assert all(2 <= x <= 48 and 2 <= y <= 28 for x, y in path[1:-1])


def test_an_example_is_the_shortest_path():
    wall = BarrierMap(7, (0, 51), (0, 31), (), (Barrier(25, 8, 30),), (Sample((5, 15), (45, 15)),))
    description, path = ExampleLibrary([wall]).solve(0)
    assert path == ((5, 15), (25, 7), (45, 15))
    assert description.values()['vertical_barriers'] == '[[25, 8, 30]]'


def test_samples_without_a_path_are_no_examples():
    closed = BarrierMap(1, (0, 51), (0, 31), (), (Barrier(25, 0, 30),), (
        Sample((5, 15), (45, 15)), Sample((25, 3), (30, 3)), Sample((5, 5), (9, 9)),
    ))  # fmt: skip
    library = ExampleLibrary([closed])
    assert [library.solve(index) is None for index in range(3)] == [True, True, False]


def test_the_query_s_own_map_is_never_an_example(library):
    own = MAPS[3]
    copies = ExampleLibrary([*MAPS[:4], replace(own, id=99)])
    for scale in (1, 3):
        scaled = own.scale(scale)
        for barrier_map, pair in ((scaled, 0), (replace(scaled, id=5), 4)):
            found = list(copies.nearest(query_of(barrier_map, pair)))
            shown = {description.horizontal_barriers for description, _ in found}
            assert len(found) > 20
            assert len(shown) == 3
            description = describe(WaypointQuery(Costmap(own.to_grid()), (3, 3), (4, 4)))
            assert description.horizontal_barriers not in shown
    assert len(list(library.nearest(query_of(MAPS[0].scale(2))))) < COUNT


def test_a_map_is_recognised_at_any_scale_offset_and_with_more_obstacles():
    own = BarrierMap(0, (-5, 20), (2, 22), (Barrier(6, -4, 8), Barrier(22, 0, 20)), ())
    for scale in (1, 2, 4):
        blocked = own.scale(scale).to_grid().blocked()
        assert is_same_map(own, blocked)
        more = blocked.copy()
        more[3, 3] = True
        assert is_same_map(own, more)
        less = blocked.copy()
        less[(6 - 2) * scale, 5 * scale] = False
        assert not is_same_map(own, less)
    assert not is_same_map(own, own.to_grid().blocked()[1:])
    assert not is_same_map(own, own.to_grid().blocked()[::2, ::2])


def test_the_most_similar_sample_comes_first():
    def sample_map(map_id, line, *samples):
        return BarrierMap(map_id, (0, 51), (0, 31), (), (Barrier(line, 8, 30),), samples)

    near, far = Sample((6, 16), (44, 15)), Sample((40, 5), (6, 20))
    maps = [
        sample_map(1, 10, far), sample_map(2, 20, near), sample_map(3, 28, near),
        sample_map(4, 29, near), sample_map(5, 28, far),
    ]  # fmt: skip
    query = query_of(sample_map(0, 26, Sample((5, 15), (45, 15))))
    found = list(ExampleLibrary(maps).nearest(query))
    order = [(d.vertical_barriers[0].line, d.start) for d, _ in found]
    assert order == [(28, (6, 16)), (29, (6, 16)), (20, (6, 16)), (28, (40, 5)), (10, (40, 5))]
    # The same at four times the scale, where the tiles and parts of the sides are the same.
    scaled = query_of(sample_map(0, 26, Sample((5, 15), (45, 15))).scale(4))
    again = list(ExampleLibrary(maps).nearest(scaled))
    assert [path for _, path in again] == [path for _, path in found]


def test_the_paths_of_similar_samples_fit_a_query_more_often(library):
    def fits(solved, query):
        corners = [(x, y) for x, y in solved.path[1:-1]]
        free = not any(query.costmap.blocked[y, x] for x, y in corners)
        way = [query.start, *corners, query.goal]
        return free and query.costmap.line_of_sight.clear_along(way)

    near, every = [], []
    for barrier_map in MAPS:
        for pair in range(0, 10, 3):
            query = query_of(barrier_map, pair)
            fitting = [fits(solved, query) for solved in library.nearest(query)]
            near += fitting[:3]
            every += fitting
    assert len(near) == 3 * 48
    assert np.mean(near) > 1.3 * np.mean(every)


def test_tiles_tell_where_obstacles_are():
    blocked = np.zeros((32, 52), dtype=bool)
    blocked[0, :] = blocked[:, -1] = True
    assert not occupied_tiles(blocked).any()
    blocked[1, 1] = blocked[30, 50] = blocked[15, 25] = True
    assert np.flatnonzero(occupied_tiles(blocked)).tolist() == [0, 24, 59]
    assert occupied_tiles(np.ones((3, 3), dtype=bool)).sum() == 1


def test_examples_keep_to_the_tokens_of_a_prompt(library):
    query = query_of(MAPS[0])
    description = describe(query)
    prompt = Prompt(load_template('few_shot'), 'message', library, 8)
    every = prompt.examples(query, description, 100_000)
    assert len(every) == 8
    nearest = [prompt.template.example(*solved) for solved in islice(library.nearest(query), 8)]
    assert every == tuple(reversed(nearest))
    for limit in (200, 500, 800):
        some = prompt.examples(query, description, limit)
        assert some == every[len(every) - len(some) :]
        size = sum(len(question) + len(answer) for question, answer in some)
        assert size + sum(map(len, description.values().values())) <= 1.5 * limit
        assert 0 < len(some) < 8
    assert Prompt(prompt.template).examples(query, description, 1000) is None


def test_files_of_examples_that_cannot_be_used_are_named(tmp_path):
    path = tmp_path / 'mine.json'
    walls = tuple(Barrier(y, 2, 9) for y in range(2, 63))
    sample = (Sample((1, 1), (1, 70)),)
    for bad, words in (
        ([], 'a JSON list of barrier maps is expected'),
        ([BarrierMap(3, (0, 9), (0, 9))], 'samples: 0, where 1 to 100000 are expected'),
        ([BarrierMap(4, (0, 80), (0, 80), walls, (), sample)], 'map 4: 61 barriers are more'),
        ([BarrierMap(5, (0, 999), (0, 999), (), (), sample)], 'map 5: 998001 cells are more'),
        (
            [BarrierMap(n, (0, 500), (0, 500), (), (), sample) for n in range(201)],
            '50250000 cells are more than 50000000; choose fewer maps',
        ),
    ):
        save_maps(bad, path)
        with pytest.raises(ExamplesError, match=rf'^examples_file: .*mine\.json.*{words}'):
            load_example_library(str(path), 1)
    path.write_text(json.dumps([{'range_x': 'wide'}]))
    with pytest.raises(ExamplesError, match=r'^examples_file: .*mine\.json: map at index 0'):
        load_example_library(str(path), 1)
    with pytest.raises(ExamplesError, match=r"^examples_file: 'none\.json' is not a file, and"):
        load_example_library('none.json', 1)
