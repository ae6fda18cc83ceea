"""Costmaps made from the one before against costmaps made from nothing."""

import gc
import tracemalloc
import weakref

import numpy as np
import pytest
from grids import held_bytes
from llm_astar_msgs_adapter.maps.grid_map import GridMap, Pose2D
from llm_astar_msgs_adapter.messages.fields import updated
from llm_astar_planner.costmap._kernels import changed_windows
from llm_astar_planner.costmap.config import CostmapConfig
from llm_astar_planner.costmap.costmap import Costmap
from llm_astar_planner.planning.planner import Planner
from llm_astar_planner.planning.types import PlanRequest
from llm_astar_planner.search.grid_graph import GridGraph
from llm_astar_planner.search.landmarks import LandmarkManager

RULES = [
    CostmapConfig(),
    CostmapConfig(robot_radius=0.2, inflation_radius=0.55, cost_scaling_factor=3.0),
    CostmapConfig(robot_radius=0.3, allow_unknown=False),
    CostmapConfig(inflation_radius=0.04, corner_cutting=True),
    CostmapConfig(occupied_threshold=99, allow_unknown=False),
    CostmapConfig(inflation_radius=1.5, cost_travel_multiplier=0.0),
    CostmapConfig(unknown_cost=0),
    CostmapConfig(inflation_radius=0.3, unknown_cost=40),
]
VALUES = np.array([-1, 0, 0, 0, 40, 64, 65, 99, 100], dtype=np.int8)


class Update:
    """A map_msgs/OccupancyGridUpdate."""

    class header:  # noqa: N801 - a field's name
        frame_id = ''

    def __init__(self, x, y, patch):
        self.x, self.y = x, y
        self.height, self.width = patch.shape
        self.data = patch.reshape(-1).tolist()


def arrays(costmap):
    """Every layer that may be taken over."""
    graph = costmap.grid_graph
    maps = costmap.blocked, costmap.cost, graph.blocked, graph.moves
    return *maps, graph.cell_surcharge, graph.packed.words


def assert_equal(one, other):
    for a, b in zip(arrays(one), arrays(other), strict=True):
        assert a.dtype == b.dtype
        np.testing.assert_array_equal(a, b)
    assert one.grid_graph.ring == other.grid_graph.ring
    assert one.grid_graph.packed.jump_points == other.grid_graph.packed.jump_points
    regions = np.column_stack((np.ravel(one.components[:, :]), np.ravel(other.components[:, :])))
    numbers = np.unique(regions, axis=0)
    # One number there for each number here, and the other way round.
    assert len(numbers) == len(np.unique(numbers[:, 0])) == len(np.unique(numbers[:, 1]))
    assert ((numbers[:, 0] == 0) == (numbers[:, 1] == 0)).all()


def assert_outside_is_unchanged(before, now):
    windows = now.changes
    covered = np.zeros(now.blocked.shape, dtype=int)
    for top, bottom, left, right in windows:
        covered[top:bottom, left:right] += 1
    assert covered.max(initial=0) <= 1
    outside = (covered == 0).ravel()
    for a, b in zip(arrays(before)[:4], arrays(now)[:4], strict=True):
        np.testing.assert_array_equal(a.ravel()[outside], b.ravel()[outside])


def next_map(grid_map, random):
    """A map as it may follow another: a message, an update, or another map altogether."""
    height, width = grid_map.cells.shape
    kind = random.choice(['update', 'message', 'same', 'clear', 'noise', 'other', 'moved'],
                         p=[0.45, 0.3, 0.05, 0.02, 0.05, 0.08, 0.05])  # fmt: skip
    if kind == 'other':
        shape = random.integers(1, 150, 2)
        resolution = float(random.choice([0.05, 0.1]))
        cells = np.where(random.random(shape) < 0.1, 100, 0).astype(np.int8)
        return GridMap(cells, resolution)
    if kind == 'moved':
        origin = Pose2D(*random.uniform(-1.0, 1.0, 2))
        return GridMap(grid_map.cells, grid_map.resolution, origin)
    if kind == 'update':
        y, x = random.integers(0, height), random.integers(0, width)
        shape = (
            random.integers(1, 1 + min(12, height - y)),
            random.integers(1, 1 + min(12, width - x)),
        )
        return updated(grid_map, Update(x, y, random.choice(VALUES, shape)))
    cells = grid_map.cells.copy()
    if kind == 'clear':
        cells[:] = 0
    if kind == 'noise':
        places = random.random(cells.shape) < random.choice([0.001, 0.1])
        cells[places] = random.choice(VALUES, int(places.sum()))
    if kind == 'message':
        for _ in range(random.integers(1, 5)):
            y, x = random.integers(0, height), random.integers(0, width)
            cells[y : y + 3, x : x + 3] = random.choice(VALUES)
    return GridMap(cells, grid_map.resolution, grid_map.origin)


@pytest.mark.parametrize('rules', RULES)
def test_after_many_updates_every_layer_equals_one_made_from_nothing(rules):
    random = np.random.default_rng(RULES.index(rules))
    grid_map = GridMap(np.zeros((80, 140), dtype=np.int8), 0.05)
    costmap = Costmap(grid_map, rules)
    costmap.prepare()
    taken_over = again = 0
    held, identities = [], {}
    for number in range(500 // len(RULES) + 1):
        before = costmap
        # Sometimes somebody keeps a costmap for longer, or a part of one of its arrays.
        held = held if random.random() < 0.4 else []
        held.append([before, [(array, array.copy()) for array in arrays(before)]])
        if random.random() < 0.3:
            array = arrays(before)[random.integers(0, 4)]
            held.append([None, [(array[1:], array[1:].copy())]])
            del array
        grid_map = next_map(grid_map, random)
        costmap = Costmap(grid_map, rules, previous=before)
        assert_equal(costmap, Costmap(grid_map, rules))
        again += identities.get(id(costmap.grid_graph.moves), number) == number - 2
        identities[id(costmap.grid_graph.moves)] = number
        if costmap.changes is not None:
            taken_over += 1
            assert_outside_is_unchanged(before, costmap)
        for _, pairs in held:
            for array, copy in pairs:
                np.testing.assert_array_equal(array, copy)
    assert taken_over > 45
    assert again  # its arrays were those of the map before the last


def test_other_rules_are_prepared_from_nothing():
    grid_map = GridMap(np.zeros((9, 9), dtype=np.int8))
    before = Costmap(grid_map, RULES[0])
    before.prepare()
    assert Costmap(grid_map, RULES[1], previous=before).changes is None
    assert len(Costmap(grid_map, RULES[0], previous=before).changes) == 0


def test_changes_far_apart_are_windows_of_their_own():
    cells = np.zeros((400, 600), dtype=np.int8)
    after = cells.copy()
    after[10:12, 10:12] = after[200, 62:66] = after[399, 599] = 100
    windows = changed_windows(cells, after, 3)
    assert sorted(map(tuple, windows.tolist())) == [
        (7, 15, 7, 15), (197, 204, 59, 69), (396, 400, 596, 600)
    ]  # fmt: skip
    assert changed_windows(cells, after + 1, 3).tolist() == [[0, 400, 0, 600]]


def test_the_costmap_before_is_not_kept_alive():
    grid_map = GridMap(np.zeros((50, 50), dtype=np.int8), 0.05)
    first = Costmap(grid_map, RULES[1])
    first.prepare()
    second = Costmap(GridMap(np.eye(50, dtype=np.int8) * 100, 0.05), RULES[1], previous=first)
    second.prepare()
    held = [weakref.ref(thing) for thing in (first, first.grid_graph, first.components)]
    moves = weakref.ref(first.grid_graph.moves)
    del first
    gc.collect()
    assert [thing() for thing in held] == [None] * 3
    # Its arrays become those of the third.
    third = Costmap(grid_map, RULES[1], previous=second)
    assert third.grid_graph.moves is moves()


def test_memory_does_not_grow_over_two_hundred_maps():
    random = np.random.default_rng(0)
    landmarks, planner = LandmarkManager(), None
    held = []
    # From the first map on: numpy keeps small arrays that were freed, and a traced one that takes
    # the place of one made before would count as growth.
    tracemalloc.start()
    # The first two hundred load what is loaded once, and fill the lists of idle tuples.
    for number in range(400):
        cells = np.zeros((150, 200), dtype=np.int8)
        for y, x in random.integers(5, 145, (8, 2)):
            cells[y : y + 4, x : x + 4] = 100
        cells[:3] = cells[:, :3] = 0
        grid_map = GridMap(cells, 0.05)
        planner = Planner(grid_map, RULES[1], landmarks=landmarks, previous=planner).prepare()
        planner.plan(PlanRequest((1, 1), (199, 1), max_suboptimality=1.1, time_limit=60.0))
        if number >= 200:
            held.append(tracemalloc.get_traced_memory()[0])
    tracemalloc.stop()
    landmarks.close()
    # Less than one layer of one of these maps.
    assert np.median(held[-20:]) - np.median(held[:20]) < 150 * 200


def test_idle_workspaces_are_bounded():
    grid = GridGraph(np.zeros((1000, 1000), dtype=bool))
    lent = [grid.borrow() for _ in range(30)]
    for workspace in lent:
        grid.give_back(workspace)
    assert 2 * held_bytes(lent[0]) < held_bytes(grid) < 100e6


def test_plans_on_both_maps_stay_right_while_they_share_workspaces():
    """A query on the old map, one on the new map, and one on the old map again."""
    cells = np.zeros((30, 40), dtype=np.int8)
    walled = cells.copy()
    walled[:28, 20] = 100
    request = PlanRequest((2, 2), (37, 2), 'exact_astar')
    before = Planner(GridMap(cells, 0.05)).prepare()
    lengths = [before.plan(request).length]
    after = Planner(GridMap(walled, 0.05), previous=before).prepare()
    assert after.costmap.changes is not None
    lengths += [after.plan(request).length, before.plan(request).length]
    fresh = Planner(GridMap(walled, 0.05)).plan(request).length
    assert lengths == [35.0, fresh, 35.0]
    assert len(before.costmap.grid_graph._spare) == 1
