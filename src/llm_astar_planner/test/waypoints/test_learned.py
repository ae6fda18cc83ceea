"""The embedded waypoint model: its inputs, its answers, and the quality of its weights."""

import gc
import os
import re
import weakref
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest
from llm_astar_msgs_adapter.maps.barrier_map import Barrier, BarrierMap, load_barrier_maps
from llm_astar_msgs_adapter.maps.grid_map import GridMap
from llm_astar_planner.costmap.costmap import Costmap
from llm_astar_planner.planning.planner import Planner
from llm_astar_planner.planning.types import PlanRequest, WaypointStatus
from llm_astar_planner.resources import find_file
from llm_astar_planner.waypoints.config import SourceSettings, make_source
from llm_astar_planner.waypoints.learned import (
    GOAL,
    MAPS_KEPT,
    MAX_HOPS,
    WEIGHTS_FILE,
    EmbeddedSource,
    WeightsError,
    draw_routes,
    featurise,
    hop_logits,
    packaged_weights,
    place_nodes,
    read_weights,
    shortest_in_sight,
    usable_nodes,
)
from llm_astar_planner.waypoints.source import SourceStatus, WaypointQuery

ROOT = Path(__file__).parents[4]
# All of these 200 samples are valid, greedy too; a broken file of weights has next to none.
GREEDY_FLOOR, BEST_FLOOR = 0.95, 0.98


@pytest.fixture(scope='module')
def queries():
    """Every fifth of the 1000 samples, none of which was trained on."""
    maps = load_barrier_maps(find_file('samples_1000.json', 'maps'))
    found = []
    for barrier_map in maps:
        grid_map = barrier_map.to_grid()
        found += [
            WaypointQuery(
                Costmap(grid_map), barrier_map.to_cell(s.start), barrier_map.to_cell(s.goal)
            )
            for s in barrier_map.samples[::5]
        ]
    return found


def points_of(query, reply):
    return np.array([query.start, *reply.waypoints, query.goal], dtype=float)


def badness(query, reply):
    points = points_of(query, reply)
    hit = int((~query.costmap.line_of_sight.clear(points[:-1], points[1:])).sum())
    return hit, 0.0 if hit else float(np.hypot(*np.diff(points, axis=0).T).sum())


def barrier_grid(horizontal=(), vertical=(), size=(51, 31)):
    ranges = ((0, side) for side in size)
    barriers = (tuple(Barrier(*b) for b in group) for group in (horizontal, vertical))
    return BarrierMap(0, *ranges, *barriers).to_grid()


SIXTY = barrier_grid([(y, 3 * y % 17, 20 + y) for y in range(2, 62)], size=(90, 70))


@pytest.fixture(scope='module')
def replies(queries):
    """What the greedy model and the best of 8 answer to them."""
    return {k: [EmbeddedSource(k).waypoints(query) for query in queries] for k in (1, 8)}


def test_the_weights_score_as_the_model_card_says(queries, replies):
    for count, floor in ((1, GREEDY_FLOOR), (8, BEST_FLOOR)):
        valid = [badness(*asked)[0] == 0 for asked in zip(queries, replies[count])]
        assert np.mean(valid) >= floor


def test_no_waypoint_lies_on_a_blocked_cell(queries, replies):
    for query, *answers in zip(queries, *replies.values()):
        blocked = query.grid_map.blocked()
        assert not any(blocked[int(y), int(x)] for reply in answers for x, y in reply.waypoints)


def test_the_best_of_several_is_never_worse_than_the_greedy_route(queries, replies):
    for query, greedy, best in zip(queries, replies[1], replies[8]):
        assert badness(query, best) <= badness(query, greedy)


def test_the_same_question_has_the_same_answer_in_any_order_and_thread(queries, replies):
    with ThreadPoolExecutor(4) as pool:
        again = list(pool.map(EmbeddedSource(8).waypoints, queries[40::-1]))
    assert again[::-1] == replies[8][:41]


def test_the_order_of_the_barriers_does_not_matter():
    barriers = np.array([[1, 10, 3, 30], [0, 25, 10, 22], [1, 15, 20, 49], [0, 8, 0, 6]], np.int32)
    size, ends = np.array([[51, 31]], np.int32), np.array([[[5, 20], [40, 5]]], np.int32)
    order = np.array([2, 0, 3, 1])
    nodes = np.concatenate([[0, 1], *(2 + 2 * k + np.array([0, 1]) for k in order)])
    logits, shuffled = (
        hop_logits(packaged_weights(), featurise(rows[None], size, ends))[0]
        for rows in (barriers, barriers[order])
    )
    assert np.allclose(logits[np.ix_(nodes, nodes)], shuffled, atol=1e-3)


def test_nodes_are_the_cells_just_beyond_barrier_ends():
    barriers = np.array([[[1, 10, 3, 30], [0, 25, 12, 12]]], np.int32)
    ends = np.array([[[5, 20], [40, 5]]], np.int32)
    cells = [[5, 20], [40, 5], [2, 10], [31, 10], [25, 11], [25, 13]]
    assert place_nodes(barriers, ends)[0].tolist() == cells


def test_nodes_are_free_cells_on_the_map_without_duplicates_but_the_goal_is_always_one():
    blocked = np.zeros((10, 10), dtype=bool)
    blocked[2, 3] = blocked[9, 9] = True
    cells = np.array([[1, 1], [9, 9], [3, 2], [5, 5], [5, 5], [-1, 4], [4, 10], [1, 1]], np.int32)
    assert usable_nodes(cells, blocked).tolist() == [True, True, False, True] + [False] * 4


def test_any_logits_make_routes_that_end_at_the_goal_and_visit_nothing_twice():
    random = np.random.default_rng(0)
    for count in (2, 3, 12, 70):
        logits = random.normal(size=(count, count)).astype(np.float32)
        logits[:, GOAL] -= 20
        routes = draw_routes(logits, np.ones(count, dtype=bool), 8, random)
        assert len(set(routes)) == len(routes)
        for route in routes:
            assert (route[0], route[-1]) == (0, GOAL)
            assert len(set(route)) == len(route) <= MAX_HOPS + 2
    alone = draw_routes(logits, np.arange(count) < 2, 8, random)
    assert alone == [(0, GOAL)]


def test_of_several_routes_the_shortest_in_sight_is_best():
    sight = Costmap(barrier_grid(horizontal=[(10, 0, 25)])).line_of_sight
    cells = np.array([[5, 5], [5, 15], [26, 10], [40, 10], [10, 8]], np.int32)
    assert shortest_in_sight([(0, 1), (0, 3, 1), (0, 2, 1)], cells, sight) == (0, 2, 1)
    assert shortest_in_sight([(0, 1), (0, 4, 1)], cells, sight) is None


def test_without_a_route_in_sight_there_are_no_waypoints():
    shut = WaypointQuery(Costmap(barrier_grid([(10, 0, 25), (10, 26, 50)])), (5, 5), (40, 20))
    reply = EmbeddedSource(8).waypoints(shut)
    assert (reply.status, reply.waypoints) == (SourceStatus.NO_WAYPOINTS, ())
    assert re.fullmatch(r'none of \d routes drawn is in sight', reply.detail)


@pytest.mark.parametrize(
    ('grid', 'start', 'goal'),
    [
        (barrier_grid(), (5, 5), (40, 20)),
        (GridMap(np.full((31, 51), 100, np.int8)), (5, 5), (40, 20)),
        (GridMap(np.zeros((1, 1), np.int8)), (0, 0), (0, 0)),
        (GridMap(np.zeros((2, 300), np.int8)), (0, 0), (299, 1)),
        (barrier_grid([(10, 0, 40)]), (7, 7), (7, 7)),
        (barrier_grid([(15, 15, 15)], [(20, 8, 8)]), (5, 5), (40, 20)),
        (barrier_grid([(10, 5, 30), (11, 5, 30)], [(20, 5, 20), (31, 10, 20)]), (10, 5), (25, 20)),
        (SIXTY, (2, 66), (80, 1)),
    ],
    ids=['empty', 'full', 'one-cell', 'no-inside', 'start-is-goal', 'dots', 'touching', 'sixty'],
)  # fmt: skip
def test_odd_maps_get_an_answer(grid, start, goal):
    for count in (1, 8):
        reply = EmbeddedSource(count).waypoints(WaypointQuery(Costmap(grid), start, goal))
        assert reply.status in (SourceStatus.OK, SourceStatus.NO_WAYPOINTS)
        assert (reply.status is SourceStatus.OK) == bool(reply.waypoints)
        blocked = grid.blocked()
        assert not any(blocked[int(y), int(x)] for x, y in reply.waypoints)


def test_old_maps_are_released_from_memory():
    """A robot that maps its surroundings publishes a new map again and again."""
    past = []
    for _ in range(MAPS_KEPT + 3):
        grid = barrier_grid([(10, 0, 25)])
        EmbeddedSource(8).waypoints(WaypointQuery(Costmap(grid), (5, 5), (5, 15)))
        past.append(weakref.ref(grid))
    del grid
    gc.collect()
    assert sum(ref() is not None for ref in past) <= MAPS_KEPT


def test_an_empty_map_needs_no_waypoints():
    reply = EmbeddedSource().waypoints(WaypointQuery(Costmap(barrier_grid()), (5, 5), (40, 20)))
    assert (reply.status, reply.waypoints) == (SourceStatus.NO_WAYPOINTS, ())


def test_its_label_says_that_it_is_no_llm_and_names_its_weights():
    source = make_source(SourceSettings(source='embedded', candidates=3))
    assert source == EmbeddedSource(3)
    planner = Planner(barrier_grid([(10, 0, 25)]))
    plan = planner.plan(PlanRequest((5, 5), (5, 15), 'guided', source))
    assert plan.guided_by.startswith('embedded:learned waypoint model ')
    assert plan.guided_by.endswith(', not an LLM')
    assert packaged_weights().digest in plan.guided_by
    assert [point.status for point in plan.checked_waypoints] == [WaypointStatus.ACCEPTED]
    assert packaged_weights().digest in (ROOT / 'docs' / 'embedded-model.md').read_text()


def test_the_weights_fit_into_ten_megabytes_and_a_broken_file_is_named():
    folder = ROOT / 'src/llm_astar_planner/llm_astar_planner/waypoints'
    data = (folder / WEIGHTS_FILE).read_bytes()
    assert len(data) < 10e6
    assert os.path.getsize(folder / WEIGHTS_FILE) == len(data)
    for broken in (b'', b'nonsense', data[: len(data) // 2]):
        with pytest.raises(WeightsError, match=r'mine\.npz: is no file of exported weights'):
            read_weights(broken, 'mine.npz')
