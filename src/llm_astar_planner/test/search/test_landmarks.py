import math
import threading
import time
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
import scipy
from grids import dijkstra, queries
from hypothesis import given, settings
from hypothesis import strategies as st
from llm_astar_planner.search._kernels.astar import NO_PATH
from llm_astar_planner.search.astar import exact_astar
from llm_astar_planner.search.distances import relaxed
from llm_astar_planner.search.grid_graph import GridGraph
from llm_astar_planner.search.landmarks import LandmarkManager, Landmarks


def lower_bound(landmarks, grid, start, goal):
    """What every path costs at least, in cells; inf: there is no path."""
    cells = grid.index(start), grid.index(goal)
    _, bound = landmarks.active(*cells, grid.octile(start, goal))
    return math.inf if bound == NO_PATH else bound / grid.straight


@settings(max_examples=150, deadline=None)
@given(queries())
def test_bounds_never_exceed_the_optimum(query):
    grid, start, goal = query
    landmarks = Landmarks.build(grid, count=3)
    if landmarks is None:
        assert not grid.moves.any()
        return
    bound = lower_bound(landmarks, grid, start, goal)
    truth = dijkstra(grid, start, goal)
    assert bound <= truth + 1e-6
    if math.isinf(bound):
        assert exact_astar(grid, start, goal).path.size == 0


@settings(max_examples=100, deadline=None)
@given(queries(), st.integers(0, 2**32 - 1))
def test_bounds_stay_admissible_with_new_obstacles(query, seed):
    grid, start, goal = query
    landmarks = Landmarks.build(grid, count=3)
    if landmarks is None:
        return
    more = grid.blocked | (np.random.default_rng(seed).random(grid.blocked.shape) < 0.2)
    more[[start[1], goal[1]], [start[0], goal[0]]] = False
    changed = GridGraph(
        more, corner_cutting=grid.corner_cutting, cost=grid.cost,
        cost_multiplier=grid.cost_multiplier, unknown_cost=grid.unknown_cost,
    )  # fmt: skip
    assert landmarks.is_admissible_on(changed)
    assert lower_bound(landmarks, changed, start, goal) <= dijkstra(changed, start, goal) + 1e-6


def test_they_are_admissible_only_while_no_cell_is_freed_or_becomes_cheaper():
    blocked = np.zeros((6, 6), dtype=bool)
    blocked[2, 1:5] = True
    cost = np.full((6, 6), 50.0)
    landmarks = Landmarks.build(GridGraph(blocked, cost=cost))
    more, less = blocked.copy(), blocked.copy()
    more[4, 4] = True
    less[2, 2] = False
    assert landmarks.is_admissible_on(GridGraph(more, cost=cost))
    assert landmarks.is_admissible_on(GridGraph(blocked, cost=cost + 1.0))
    assert not landmarks.is_admissible_on(GridGraph(less, cost=cost))
    assert not landmarks.is_admissible_on(GridGraph(blocked, cost=cost - 1.0))
    assert not landmarks.is_admissible_on(GridGraph(blocked))
    assert not landmarks.is_admissible_on(GridGraph(blocked, cost=cost, corner_cutting=True))
    assert not landmarks.is_admissible_on(
        GridGraph(np.zeros((5, 6), dtype=bool), cost=np.zeros((5, 6)))
    )


def test_in_a_corridor_the_bound_is_exact():
    blocked = np.zeros((3, 30), dtype=bool)
    blocked[1, :29] = True
    grid = GridGraph(blocked)
    landmarks = Landmarks.build(grid)
    truth = dijkstra(grid, (0, 0), (0, 2))
    assert truth > 29.0
    assert abs(lower_bound(landmarks, grid, (0, 0), (0, 2)) - truth) < 1e-5


def test_they_prove_that_cells_are_not_connected():
    blocked = np.zeros((3, 9), dtype=bool)
    blocked[:, 4] = True
    grid = GridGraph(blocked)
    landmarks = Landmarks.build(grid)
    assert lower_bound(landmarks, grid, (0, 0), (8, 0)) == math.inf


def test_memory_is_bounded():
    grid = GridGraph(np.zeros((50, 50), dtype=bool))
    assert Landmarks.build(grid).count == 32
    few = Landmarks.build(grid, max_bytes=3 * 4 * 2500)
    assert few.count == 3
    assert few.distances.nbytes <= 3 * 4 * 2500
    assert Landmarks.build(grid, max_bytes=100) is None
    assert Landmarks.build(GridGraph(np.ones((4, 4), dtype=bool))) is None


def test_a_raised_stop_flag_ends_the_build():
    grid = GridGraph(np.zeros((200, 200), dtype=bool))
    assert Landmarks.build(grid, stop=np.ones(1, dtype=np.uint8)) is None


def random_map(random, size, *, graded, corner_cutting):
    """A map of two halves that a few gaps may join."""
    blocked = random.random(size) < 0.25
    blocked[size[0] // 2] = random.random(size[1]) < 0.97
    cost = random.integers(0, 101, size) if graded else None
    return GridGraph(blocked, corner_cutting=corner_cutting, cost=cost)


def changed_map(random, grid, share=0.02):
    """The map with some cells blocked, freed, dearer or cheaper."""
    size = grid.blocked.shape
    blocked = grid.blocked ^ (random.random(size) < share)
    cost = None
    if grid.cost is not None:
        some = random.random(size) < share
        cost = np.where(some, random.integers(0, 101, size), grid.cost)
    return GridGraph(blocked, corner_cutting=grid.corner_cutting, cost=cost)


def assert_exact(landmarks, freest):
    """Each row holds the shortest distances on a map, measured from nothing."""
    sources = (landmarks.distances == 0).argmax(axis=1)
    assert (landmarks.distances[range(landmarks.count), sources] == 0).all()
    lengths = scipy.sparse.csgraph.dijkstra(edges(freest), indices=sources)
    lengths[np.isinf(lengths)] = -1
    assert (landmarks.distances == lengths).all()


def edges(freest):
    """The map as a sparse matrix of whole lengths in units."""
    shift = np.array([1, freest.width, -1, -freest.width])
    shift = np.append(shift, [shift[0] + shift[1], shift[1] + shift[2],
                              shift[2] + shift[3], shift[3] + shift[0]])  # fmt: skip
    bits = freest.moves[:, None] >> np.arange(8) & 1
    cells, moves = np.nonzero(bits)
    others = cells + shift[moves]
    lengths = np.where(moves < 4, freest.straight, freest.diagonal).astype(np.int64)
    if freest.cell_surcharge.size:
        sums = freest.cell_surcharge[cells].astype(np.int64) + freest.cell_surcharge[others]
        lengths += lengths * sums >> 9
    shape = (freest.moves.size, freest.moves.size)
    return scipy.sparse.csr_array((lengths.astype(float), (cells, others)), shape=shape)


def assert_covers(freest, union):
    """The first map has all moves of the second, at no higher cost, and the same both ways."""
    assert not (union.moves & ~freest.moves).any()
    if union.cell_surcharge.size:
        assert (freest.cell_surcharge <= union.cell_surcharge)[union.moves != 0].all()
    matrix = edges(freest)
    assert (matrix != matrix.T).nnz == 0


class Union:
    """What was ever legal, at its least cost, written down by the rule."""

    def __init__(self, grid):
        self.width, self.straight, self.diagonal = grid.width, grid.straight, grid.diagonal
        self.moves = grid.moves.copy()
        self.cell_surcharge = grid.cell_surcharge.copy()

    def add(self, grid):
        if grid.cell_surcharge.size:
            least = np.minimum(self.cell_surcharge, grid.cell_surcharge)
            least = np.where(self.moves == 0, grid.cell_surcharge, least)
            self.cell_surcharge = np.where(grid.moves == 0, self.cell_surcharge, least)
        self.moves = self.moves | grid.moves


@pytest.mark.parametrize('graded', [False, True])
@pytest.mark.parametrize('corner_cutting', [False, True])
def test_repaired_distances_equal_new_ones_on_what_was_ever_free(graded, corner_cutting):
    random = np.random.default_rng(7)
    for size in ((9, 9), (23, 31), (40, 33)):
        grid = random_map(random, size, graded=graded, corner_cutting=corner_cutting)
        landmarks, union = Landmarks.build(grid, count=3), Union(grid)
        for step in range(70):
            grid = changed_map(random, grid, (0.001, 0.01, 0.1)[step % 3])
            before = landmarks.is_admissible_on(grid)
            changed = landmarks.merge(grid)
            assert before == (changed.size == 0)
            assert list(landmarks.repair(changed))[-1]
            union.add(grid)
            assert landmarks.is_admissible_on(grid)
            if step % 5 == 0:
                assert_exact(landmarks, landmarks.freest)
                assert_covers(landmarks.freest, union)


@pytest.mark.parametrize('corner_cutting', [False, True])
def test_numpy_measures_the_distances_of_the_kernel(corner_cutting):
    random = np.random.default_rng(11)
    for size in ((1, 1), (9, 9), (23, 31)):
        grid = random_map(random, size, graded=False, corner_cutting=corner_cutting)
        landmarks = Landmarks.build(grid, count=3)
        for row in [] if landmarks is None else landmarks.distances:
            assert (relaxed(grid.cells, int((row == 0).argmax())) == row).all()


def test_corners_may_be_cut_from_one_map_to_the_next():
    blocked = np.random.default_rng(3).random((30, 30)) < 0.35
    landmarks = Landmarks.build(GridGraph(blocked), count=4)
    cutting = GridGraph(blocked, corner_cutting=True)
    assert list(landmarks.repair(landmarks.merge(cutting)))[-1]
    assert_exact(landmarks, landmarks.freest)
    assert_covers(landmarks.freest, Union(cutting))
    assert landmarks.merge(GridGraph(blocked)).size == 0


@pytest.mark.parametrize('graded', [False, True])
def test_a_moving_obstacle_is_left_out_and_nothing_else(graded):
    size = 60
    wall, before, after = np.s_[30, 10:], np.s_[5:15, 20:30], np.s_[5:15, 21:31]

    def world(*blocks):
        blocked = np.zeros((size, size), dtype=bool)
        for block in blocks:
            blocked[block] = True
        far = scipy.ndimage.distance_transform_cdt(~blocked, 'chessboard')
        cost = np.where(blocked, 100, np.maximum(60 - 20 * far, 0)) if graded else None
        return GridGraph(blocked, cost=cost)

    landmarks = Landmarks.build(world(wall, before), count=2)
    assert list(landmarks.repair(landmarks.merge(world(wall, after))))[-1]
    without = world(wall)
    assert (landmarks.freest.moves == without.moves).all()
    if graded:
        free = without.moves != 0
        assert (landmarks.freest.cell_surcharge == without.cell_surcharge)[free].all()
    assert_exact(landmarks, landmarks.freest)


def test_a_long_repair_takes_several_steps_and_can_be_stopped():
    blocked = np.zeros((200, 200), dtype=bool)
    blocked[100] = True
    for stopped in (False, True):
        landmarks = Landmarks.build(GridGraph(blocked), count=3)
        stop = np.zeros(1, dtype=np.uint8)
        repair = landmarks.repair(landmarks.merge(GridGraph(blocked & False)), stop)
        assert next(repair) is False
        stop[0] = stopped
        rest = list(repair)
        assert rest[-1:] != [True] if stopped else rest[-1]
    assert_exact(
        Landmarks.build(GridGraph(blocked & False), count=3), Union(GridGraph(blocked & False))
    )


@pytest.fixture
def manager():
    manager = LandmarkManager(count=4)
    yield manager
    manager.close()


def free_map(size, *walls):
    blocked = np.zeros((size, size), dtype=bool)
    for wall in walls:
        blocked[wall] = True
    return GridGraph(blocked)


def test_the_manager_repairs_what_becomes_freer(manager):
    walled = free_map(20, np.s_[10, 2:])
    with manager.lend(walled) as landmarks:
        assert landmarks is None
    manager.update(walled)
    assert manager.wait(60.0)
    with manager.lend(walled) as landmarks:
        first = landmarks
    more = free_map(20, np.s_[10, 2:], np.s_[5, 5])
    freed = free_map(20)
    with manager.lend(more) as landmarks:
        assert landmarks is first
    with manager.lend(freed) as landmarks:
        assert landmarks is None
    manager.update(more)
    manager.update(freed)
    for grid in (walled, more, freed):
        with manager.lend(grid) as landmarks:
            assert landmarks is first
    assert_exact(first, Union(freed))
    assert manager.values() == {'landmarks': 4, 'landmark_builds': 1}


def test_what_is_lent_does_not_change(manager):
    walled, freed = free_map(20, np.s_[10, 2:]), free_map(20)
    manager.update(walled)
    manager.wait(60.0)
    with manager.lend(walled) as landmarks:
        before = landmarks.distances.copy()
        manager.update(freed)
        assert (landmarks.distances == before).all()
        with manager.lend(freed) as others:
            assert others is None
    assert manager.wait(60.0)
    with manager.lend(freed) as landmarks:
        assert_exact(landmarks, Union(freed))


def test_a_long_repair_is_finished_in_the_background(manager):
    walled, freed = free_map(300, np.s_[150]), free_map(300)
    manager.update(walled)
    manager.wait(60.0)
    manager.update(freed)
    assert manager.wait(60.0)
    with manager.lend(freed) as landmarks:
        assert_exact(landmarks, Union(freed))
    assert manager.values()['landmark_builds'] == 1


@pytest.mark.parametrize('first', [free_map(40), free_map(40, np.s_[:35])])
def test_landmarks_are_measured_anew_when_the_map_is_much_stricter_or_mostly_new(manager, first):
    last = free_map(40, np.s_[10:30])
    for grid in (first, *80 * [last]):
        manager.update(grid)
        manager.wait(60.0)
    with manager.lend(last) as landmarks:
        assert landmarks.freest.free == np.count_nonzero(last.moves)
    assert manager.values()['landmark_builds'] == 2


def test_a_map_of_another_size_or_kind_gets_landmarks_of_its_own(manager):
    flat = free_map(20)
    for grid in (flat, free_map(30), GridGraph(flat.blocked, cost=np.ones((20, 20))), flat):
        manager.update(grid)
        assert manager.wait(60.0)
        with manager.lend(grid) as landmarks:
            assert landmarks.distances.shape == (4, grid.moves.size)
            assert landmarks.is_admissible_on(grid)


def test_threads_that_search_while_the_map_changes_get_true_bounds(manager):
    random = np.random.default_rng(2)
    grid = random_map(random, (60, 60), graded=True, corner_cutting=False)
    grids = [grid]
    for _ in range(40):
        grids.append(changed_map(random, grids[-1]))
    manager.update(grids[0])
    manager.wait(60.0)
    queries = random.integers(0, 60, (40, 2, 2)).tolist()
    failures, used, done = [], [], threading.Event()

    def search(seed):
        order = np.random.default_rng(seed)
        while not done.is_set():
            grid = grids[order.integers(len(grids))]
            start, goal = queries[order.integers(len(queries))]
            with manager.lend(grid) as landmarks:
                if landmarks is None:
                    continue
                bound = lower_bound(landmarks, grid, tuple(start), tuple(goal))
                used.append(bound)
                truth = exact_astar(grid, tuple(start), tuple(goal)).cost
                # The units' diagonals are longer than exact ones by 5e-8.
                if bound > (truth if truth == truth else math.inf) * (1.0 + 1e-7):
                    failures.append((bound, truth))

    def update(step):
        for grid in grids[::step]:
            manager.update(grid)
        assert manager.wait(60.0)

    with ThreadPoolExecutor() as pool:
        searches = [pool.submit(search, seed) for seed in range(3)]
        updates = [pool.submit(update, step) for step in (1, -1)]
        try:
            for future in updates:
                future.result()
            manager.update(grids[-1])
            manager.wait(60.0)
            # On a busy machine the updates may be over before a search has had any.
            end = time.monotonic() + 60.0
            while not used and time.monotonic() < end:
                time.sleep(0.01)
        finally:
            done.set()
        for future in searches:
            future.result()
    assert not failures
    assert used
    with manager.lend(grids[-1]) as landmarks:
        assert landmarks is not None


def test_close_ends_a_build_and_does_not_wait_for_who_has_landmarks():
    manager = LandmarkManager()
    walled, freed = free_map(20, np.s_[10, 2:]), free_map(20)
    manager.update(walled)
    manager.wait(60.0)
    with manager.lend(walled) as landmarks:
        before = landmarks.distances.copy()
        manager.update(freed)
        manager.close()
        assert (landmarks.distances == before).all()
    manager.update(freed)
    assert manager.wait(60.0)
    with manager.lend(freed) as landmarks:
        assert landmarks is None
    busy = LandmarkManager()
    busy.update(free_map(1000))
    busy.close()
    assert busy.current is None


def test_there_are_none_where_two_do_not_fit():
    manager = LandmarkManager(max_bytes=7 * 100)
    manager.update(free_map(10))
    assert manager.wait(0.0)
    with manager.lend(free_map(10)) as landmarks:
        assert landmarks is None
