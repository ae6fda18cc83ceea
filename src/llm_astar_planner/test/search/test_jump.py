"""The jump point search against the exact A*, and its packed maps against their definition."""

import csv
import math
import os
import threading
import time
from pathlib import Path

import numpy as np
import pytest
from grids import assert_path, dijkstra
from llm_astar_msgs_adapter.maps.movingai import load_map
from llm_astar_planner.search.arrays import no_stop
from llm_astar_planner.search.astar import EXPANSION_SLICE, JumpSearch, exact_astar, jump_search
from llm_astar_planner.search.grid_graph import GridGraph, PackedGrid
from llm_astar_planner.search.landmarks import Landmarks
from llm_astar_planner.search.result import SearchStatus


def random_map(random, largest):
    """Noise of any density with walls, blocks and clearings laid over it."""
    height, width = random.integers(1, largest, 2)
    blocked = random.random((height, width)) < random.choice([0.0, 0.02, 0.1, 0.2, 0.3, 0.4])
    for _ in range(random.integers(0, 7)):
        y, x = random.integers(0, (height, width))
        size = random.integers(1, (height + 1, width + 1))
        if random.random() < 0.6:
            size[random.integers(2)] = 1
        blocked[y : y + size[0], x : x + size[1]] = random.random() < 0.7
    return blocked


def random_query(random, blocked):
    """Two free cells of a map, freed for it if need be."""
    cells = random.integers(0, blocked.shape[::-1], (2, 2))
    blocked[cells[:, 1], cells[:, 0]] = False
    return [(int(x), int(y)) for x, y in cells]


def rooms(size, room, random):
    """Square rooms with a door in most of their walls."""
    blocked = np.zeros((size, size), dtype=bool)
    blocked[::room] = blocked[:, ::room] = True
    for y in range(0, size - room, room):
        for x in range(0, size - room, room):
            door = 1 + random.integers(room - 1)
            blocked[y + door, x] = random.random() < 0.2
            blocked[y, x + door] = random.random() < 0.2
    return blocked


def maze(size, random):
    """Corridors one cell wide, without loops (a binary tree)."""
    blocked = np.ones((size, size), dtype=bool)
    blocked[1:-1:2, 1:-1:2] = False
    for y in range(1, size - 1, 2):
        for x in range(1, size - 1, 2):
            if x + 2 < size - 1 and (random.random() < 0.5 or y + 2 >= size - 1):
                blocked[y, x + 1] = False
            elif y + 2 < size - 1:
                blocked[y + 1, x] = False
    return blocked


def assert_same(grid, start, goal, landmarks=None):
    """The jump point search finds what the exact A* finds, by legal moves."""
    expected = exact_astar(grid, start, goal, want_expanded=False)
    result = jump_search(grid, start, goal, stop=no_stop(), landmarks=landmarks)
    assert result.status is expected.status
    assert result.cost == expected.cost
    if expected.status is SearchStatus.FOUND:
        assert_path(grid, result.path, start, goal, result.cost)
        assert result.length == pytest.approx(expected.length)
        assert result.suboptimality_bound == 1.0


@pytest.mark.parametrize(('largest', 'count'), [(9, 1500), (24, 1500), (150, 150)])
def test_it_is_exact_on_random_maps(largest, count):
    random = np.random.default_rng(largest)
    for _ in range(count):
        blocked = random_map(random, largest)
        start, goal = random_query(random, blocked)
        assert_same(GridGraph(blocked), start, goal)


def test_it_is_exact_by_the_rule_alone():
    random = np.random.default_rng(1)
    for _ in range(150):
        blocked = random_map(random, 12)
        start, goal = random_query(random, blocked)
        grid = GridGraph(blocked)
        result = jump_search(grid, start, goal, stop=no_stop())
        truth = dijkstra(grid, start, goal)
        assert result.cost == pytest.approx(truth, abs=len(result.path) / grid.straight + 1e-6)


@pytest.mark.parametrize('make', [lambda random: rooms(200, 11, random), lambda r: maze(181, r)])
def test_it_is_exact_in_rooms_and_mazes(make):
    random = np.random.default_rng(2)
    blocked = make(random)
    grid = GridGraph(blocked)
    landmarks = Landmarks.build(grid, count=4)
    free = np.argwhere(~blocked)[:, ::-1]
    for cells in random.choice(free, (40, 2)):
        start, goal = ((int(x), int(y)) for x, y in cells)
        assert_same(grid, start, goal)
        assert_same(grid, start, goal, landmarks)


def test_landmarks_change_no_cost_and_spare_expansions():
    random = np.random.default_rng(3)
    blocked = rooms(300, 13, random)
    blocked[1, 1] = blocked[298, 298] = False
    grid = GridGraph(blocked)
    landmarks = Landmarks.build(grid, count=8)
    plain = jump_search(grid, (1, 1), (298, 298), stop=no_stop())
    led = jump_search(grid, (1, 1), (298, 298), stop=no_stop(), landmarks=landmarks)
    assert led.cost == plain.cost
    assert led.expansions < plain.expansions


def test_published_optimal_lengths():
    folder = os.environ.get('LLM_ASTAR_REFERENCE')
    if not folder:
        pytest.skip('LLM_ASTAR_REFERENCE is not set')
    grids = {}
    with (Path(folder) / 'grids' / 'scenarios.csv').open() as file:
        for row in csv.DictReader(file):
            name = row['map']
            if name not in grids:
                path = Path(folder) / 'grids' / f'{name}.map'
                grids[name] = GridGraph(load_map(path).blocked())
            start = int(row['start_x']), int(row['start_y'])
            goal = int(row['goal_x']), int(row['goal_y'])
            result = jump_search(grids[name], start, goal, stop=no_stop())
            assert abs(result.length - float(row['optimal_length'])) <= 0.005
            assert_path(grids[name], result.path, start, goal, result.cost)


def packed_by_definition(blocked):
    """Return what PackedGrid holds as bools: for either axis blocked cells and stops."""
    found = []
    for along in (blocked, blocked.T):
        wall = np.pad(along, 1, constant_values=True)
        for step in (1, -1):
            behind = np.roll(wall, step, axis=1)
            ended = np.zeros_like(wall)
            for side in (1, -1):
                beside = np.roll(wall, side, axis=0)
                ended |= np.roll(beside, step, axis=1) & ~beside
            found.append((wall | (ended & ~behind))[1:-1, 1:-1])
    return found


def unpack(packed, height, width):
    """Return the same from the words of a PackedGrid."""
    row_words, column_words = (width + 65) // 64, (height + 65) // 64
    rows = packed.words[3 : 3 * (1 + (height + 2) * row_words)]
    columns = packed.words[3 * (1 + (height + 2) * row_words) : -3]
    found = []
    for words, line_words in ((rows, row_words), (columns, column_words)):
        lines = words.reshape(-1, line_words, 3)
        across, along = (height, width) if words is rows else (width, height)
        for plane in (1, 2):
            octets = np.ascontiguousarray(lines[..., plane]).view(np.uint8)
            bits = np.unpackbits(octets, axis=1, bitorder='little').astype(bool)
            found.append(bits[1 : across + 1, 1 : along + 1])
    return found


def test_a_packed_map_holds_its_walls_and_stops():
    random = np.random.default_rng(4)
    for size in [(1, 1), (1, 200), (62, 63), (64, 62), (65, 126), (130, 70)]:
        blocked = random.random(size) < 0.3
        packed = PackedGrid.build(blocked)
        expected = packed_by_definition(blocked)
        for bits, truth in zip(unpack(packed, *size), expected, strict=True):
            np.testing.assert_array_equal(bits, truth)
        assert packed.blocked_cells == blocked.sum()
        stops = [truth & ~wall for truth, wall in zip(expected, [blocked] * 2 + [blocked.T] * 2)]
        assert packed.jump_points == sum(int(stop.sum()) for stop in stops)


def test_an_updated_map_is_the_one_built_from_nothing():
    random = np.random.default_rng(5)
    for size in [(1, 1), (40, 90), (126, 127), (200, 65)]:
        blocked = random.random(size) < 0.2
        packed = PackedGrid.build(blocked)
        for _ in range(60):
            before = packed.words.copy()
            blocked = blocked.copy()
            windows = []
            for _ in range(random.integers(0, 4)):
                top, left = random.integers(0, size)
                bottom = min(top + random.integers(0, 30), size[0])
                right = min(left + random.integers(0, 30), size[1])
                shape = (bottom - top, right - left)
                blocked[top:bottom, left:right] = random.random(shape) < random.random()
                windows.append([top, bottom, left, right])
            updated = packed.updated(blocked, np.array(windows, dtype=np.int64).reshape(-1, 4))
            fresh = PackedGrid.build(blocked)
            np.testing.assert_array_equal(packed.words, before)
            np.testing.assert_array_equal(updated.words, fresh.words)
            assert updated.blocked_cells == fresh.blocked_cells
            assert updated.jump_points == fresh.jump_points
            packed = updated


def test_start_as_goal_and_ends_without_a_path():
    blocked = np.zeros((3, 5), dtype=bool)
    blocked[:, 2] = True
    grid = GridGraph(blocked)
    here = jump_search(grid, (1, 2), (1, 2), stop=no_stop())
    assert here.path.tolist() == [[1, 2]]
    assert here.cost == 0.0
    for start, goal in [((0, 0), (4, 2)), ((2, 0), (0, 0)), ((0, 0), (2, 1))]:
        result = jump_search(grid, start, goal, stop=no_stop())
        assert result.status is SearchStatus.EXHAUSTED
        assert len(result.path) == 0


def test_grids_of_another_kind_are_refused():
    free = np.zeros((3, 3), dtype=bool)
    for grid in (GridGraph(free, corner_cutting=True), GridGraph(free, cost=np.eye(3))):
        with pytest.raises(ValueError, match='uniform costs and no corner cutting'):
            jump_search(grid, (0, 0), (2, 2), stop=no_stop())
    with pytest.raises(ValueError, match='off a grid'):
        jump_search(GridGraph(free), (0, 3), (2, 2), stop=no_stop())


def test_a_cost_beyond_32_bits_is_refused():
    grid = GridGraph(np.zeros((2, 400), dtype=bool))
    grid.set_units(*(value * 4000 for value in (2378, 3363)))
    with pytest.raises(OverflowError):
        jump_search(grid, (0, 0), (399, 1), stop=no_stop())


def test_a_raised_stop_flag_and_a_passed_deadline_end_the_search():
    random = np.random.default_rng(6)
    blocked = random.random((600, 600)) < 0.35
    blocked[:30, :30] = False
    blocked[-3:, -3:] = True
    blocked[-2, -2:] = False  # cannot be reached: the search goes everywhere
    grid = GridGraph(blocked)
    everywhere = jump_search(grid, (0, 0), (598, 598), stop=no_stop())
    assert everywhere.status is SearchStatus.EXHAUSTED
    stopped = jump_search(grid, (0, 0), (598, 598), stop=np.ones(1, dtype=np.uint8))
    late = jump_search(grid, (0, 0), (598, 598), stop=no_stop(), deadline=time.monotonic())
    for result in (stopped, late):
        assert result.status is SearchStatus.STOPPED
        assert result.expansions < everywhere.expansions / 2
        assert result.cost == math.inf


def test_many_threads_may_share_a_grid():
    random = np.random.default_rng(7)
    blocked = rooms(150, 10, random)
    blocked[1, 1] = blocked[148, 148] = False
    grid = GridGraph(blocked)
    expected = exact_astar(grid, (1, 1), (148, 148)).cost
    costs = []

    def work():
        costs.extend(jump_search(grid, (1, 1), (148, 148), stop=no_stop()).cost for _ in range(20))

    threads = [threading.Thread(target=work) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert costs == [expected] * 80


def test_the_expanded_cells_are_the_jump_points_taken_from_the_queue():
    blocked = np.zeros((9, 20), dtype=bool)
    blocked[:6, 8] = True
    search = JumpSearch(GridGraph(blocked), (1, 1), (18, 1))
    while search.status is None:
        search.advance(EXPANSION_SLICE)
    expanded = np.zeros_like(blocked)
    search.add_expanded(expanded)
    search.grid.give_back(search.workspace)
    # From the start to the cell past the end of the wall, and from there to the goal.
    assert search.expansions == expanded.sum() == 2
    assert expanded[1, 1]
    assert expanded[6, 9]


def test_only_paths_cheaper_than_one_known_are_looked_for():
    blocked = np.zeros((20, 20), dtype=bool)
    blocked[5, :15] = True
    grid = GridGraph(blocked)
    optimum = round(exact_astar(grid, (2, 2), (3, 12)).cost * grid.straight)
    for known, is_better in [(optimum, False), (optimum + 1, True)]:
        search = JumpSearch(grid, (2, 2), (3, 12))
        search.learn(known)
        while search.status is None:
            search.advance(EXPANSION_SLICE)
        assert search.best == search.bound == optimum
        if is_better:
            assert search.path()[2] == optimum
        search.grid.give_back(search.workspace)
