import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from llm_astar_msgs_adapter.maps.barrier_decomposition import coarsen, decompose_barriers, halve
from llm_astar_msgs_adapter.maps.barrier_map import Barrier, BarrierMap

WIDTH, HEIGHT = 51, 31


def barrier(line_end, along_end):
    ends = st.lists(st.integers(0, along_end), min_size=2, max_size=2).map(sorted)
    return st.builds(lambda line, pair: Barrier(line, *pair), st.integers(0, line_end), ends)


barrier_maps = st.builds(
    lambda horizontal, vertical: BarrierMap(
        0, (0, WIDTH), (0, HEIGHT), tuple(horizontal), tuple(vertical)
    ),
    st.lists(barrier(HEIGHT, WIDTH), max_size=6),
    st.lists(barrier(WIDTH, HEIGHT), max_size=6),
)


def count(barrier_map):
    return len(barrier_map.horizontal_barriers) + len(barrier_map.vertical_barriers)


@settings(max_examples=60)
@given(barrier_maps)
def test_decomposing_a_barrier_map_blocks_the_same_cells(barrier_map):
    grid = barrier_map.to_grid()
    summary = decompose_barriers(grid.blocked(), limit=40)
    np.testing.assert_array_equal(summary.to_grid().cells, grid.cells)


def test_a_plain_map_gives_back_its_own_barriers():
    barrier_map = BarrierMap(
        0, (0, WIDTH), (0, HEIGHT), (Barrier(10, 3, 25),), (Barrier(25, 10, 22),)
    )
    summary = decompose_barriers(barrier_map.to_grid().blocked())
    assert summary.horizontal_barriers == barrier_map.horizontal_barriers
    assert summary.vertical_barriers == barrier_map.vertical_barriers


def test_coordinates_are_cells_whatever_the_origin():
    barrier_map = BarrierMap(0, (-20, 31), (5, 36), (Barrier(10, -17, 5),))
    grid = barrier_map.to_grid(resolution=0.1)
    assert decompose_barriers(grid.blocked()).horizontal_barriers == (Barrier(5, 3, 25),)


@given(st.integers(0, 2**32 - 1), st.integers(1, 12))
@settings(max_examples=30)
def test_never_more_than_the_limit_and_always_on_the_map(seed, limit):
    blocked = np.random.default_rng(seed).choice([False, True], size=(80, 130), p=[0.8, 0.2])
    summary = decompose_barriers(blocked, limit)
    assert 1 <= count(summary) <= limit
    for line, first, last in summary.horizontal_barriers:
        assert 0 <= line < 80
        assert 0 <= first <= last < 130
    for line, first, last in summary.vertical_barriers:
        assert 0 <= line < 130
        assert 0 <= first <= last < 80


def test_a_thick_wall_becomes_few_barriers_that_still_close_the_way():
    blocked = np.zeros((200, 300), dtype=np.bool_)
    blocked[:150, 140:156] = True
    summary = decompose_barriers(blocked, limit=6)
    assert count(summary) <= 6
    walls = summary.vertical_barriers
    assert walls
    assert all(130 <= wall.line <= 165 for wall in walls)
    assert min(wall.first for wall in walls) <= 8
    assert 140 <= max(wall.last for wall in walls) <= 160


def test_a_free_map_has_no_barriers():
    assert count(decompose_barriers(np.zeros((40, 40), dtype=np.bool_))) == 0


def test_a_limit_below_one_is_refused():
    with pytest.raises(ValueError, match='limit'):
        decompose_barriers(np.zeros((4, 4), dtype=np.bool_), limit=0)


def test_a_coarse_cell_is_set_where_enough_of_its_cells_are():
    cells = np.zeros((5, 4), dtype=np.bool_)
    cells[[0, 0, 4], [0, 1, 3]] = True
    np.testing.assert_array_equal(coarsen(cells, 2), [[1, 0], [0, 0], [0, 1]])
    np.testing.assert_array_equal(coarsen(cells, 2, minimum=2), [[1, 0], [0, 0], [0, 0]])
    assert coarsen(cells, 1) is cells


@pytest.mark.parametrize('shape', [(1, 1), (7, 10), (8, 5), (30, 31)])
def test_halving_is_coarsening_by_two(shape):
    cells = np.random.default_rng(1).random(shape) < 0.2
    np.testing.assert_array_equal(halve(cells), coarsen(cells, 2))
    np.testing.assert_array_equal(halve(halve(cells)), coarsen(cells, 4))
