import math
from itertools import combinations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from llm_astar_msgs_adapter.maps.grid_map import GridMap, GridMapError, Pose2D

CELLS = np.array([[0, 100, -1], [64, 65, 0]], dtype=np.int8)


def test_cells_are_blocked_from_the_threshold_up_and_unknown_ones_on_request():
    grid = GridMap(CELLS)
    assert grid.blocked().tolist() == [[False, True, False], [False, True, False]]
    assert grid.blocked(64).tolist() == [[False, True, False], [True, True, False]]
    strict = grid.blocked(allow_unknown=False)
    assert strict.tolist() == [[False, True, True], [False, True, False]]


def test_a_cell_is_x_then_y():
    grid = GridMap(CELLS, resolution=0.5, origin=Pose2D(1.0, 2.0))
    assert (grid.width, grid.height) == (3, 2)
    assert grid.contains((2, 1))
    assert not grid.contains((1, 2))
    assert not grid.contains((-1, 0))
    assert grid.world_to_cell(2.4, 2.1) == (2, 0)
    np.testing.assert_allclose(grid.grid_to_world([[2, 0]]), [[2.25, 2.25]])


def test_an_origin_with_yaw_turns_the_cells_about_their_corner():
    grid = GridMap(CELLS, resolution=2.0, origin=Pose2D(10.0, 0.0, math.pi / 2))
    np.testing.assert_allclose(grid.grid_to_world([[0, 0]]), [[9.0, 1.0]])
    assert grid.world_to_cell(9.0, 1.0) == (0, 0)
    assert grid.world_to_cell(9.0, 5.0) == (2, 0)
    assert grid.world_to_cell(7.0, 1.0) == (0, 1)


@given(
    st.floats(-1e4, 1e4),
    st.floats(-1e4, 1e4),
    st.floats(-10, 10),
    st.floats(0.01, 10),
    st.integers(0, 3000),
    st.integers(0, 3000),
)
def test_cell_centres_survive_the_round_trip_through_metres(x, y, yaw, resolution, column, row):
    grid = GridMap(CELLS, resolution, Pose2D(x, y, yaw))
    place = grid.grid_to_world([[column, row]])
    np.testing.assert_allclose(grid.world_to_grid(place), [[column, row]], atol=1e-6)
    assert grid.world_to_cell(*place[0]) == (column, row)


@given(st.lists(st.tuples(st.floats(-1e15, 1e15), st.floats(-1e3, 1e3)), max_size=5))
def test_the_cells_of_many_points_are_those_of_each(points):
    grid = GridMap(CELLS, 0.05, Pose2D(-3.0, 4.0, 0.3))
    each = [grid.world_to_cell(*point) for point in points]
    np.testing.assert_allclose(grid.world_to_cells(points), np.reshape(each, (-1, 2)), atol=1e-3)
    on_borders = [(-0.1 + 0.05 * n, 0.05 * n) for n in range(40)]
    straight = GridMap(CELLS, 0.05, Pose2D(-0.15, 0.0))
    cells = [straight.world_to_cell(*point) for point in on_borders]
    assert straight.world_to_cells(on_borders).tolist() == [list(cell) for cell in cells]
    with pytest.raises(GridMapError, match='points: hold a number that is not finite'):
        grid.world_to_cells([*points, (0.0, math.inf)])


def test_a_point_on_a_border_belongs_to_the_higher_cell():
    grid = GridMap(CELLS, resolution=0.05, origin=Pose2D(-0.15, 0.0))
    assert grid.world_to_cell(-0.1, 0.05) == (1, 1)


def test_the_cells_of_a_map_are_read_only():
    cells = CELLS.copy()
    grid = GridMap(cells)
    cells[0, 0] = 100
    assert grid.cells[0, 0] == 0
    with pytest.raises(ValueError, match='read-only'):
        grid.cells[0, 0] = 1


def test_different_maps_have_different_digests():
    maps = [
        GridMap(CELLS),
        GridMap(CELLS.T),
        GridMap(CELLS, 0.5),
        GridMap(CELLS, origin=Pose2D(1.0, 0.0)),
        GridMap(CELLS, frame_id='odom'),
        GridMap(np.zeros_like(CELLS)),
    ]
    assert len({grid.digest for grid in maps}) == len(maps)
    assert GridMap(CELLS.copy()).digest == maps[0].digest
    assert GridMap(CELLS.copy()).is_equal_to(maps[0])
    assert not any(one.is_equal_to(other) for one, other in combinations(maps, 2))


@pytest.mark.parametrize(
    ('field', 'arguments'),
    [
        ('cells', {'cells': np.zeros(4)}),
        ('cells', {'cells': np.zeros((0, 3))}),
        ('cells', {'cells': np.full((2, 2), 101)}),
        ('cells', {'cells': np.full((2, 2), -2)}),
        ('cells', {'cells': np.append(np.zeros(300_000), 101)[None]}),
        ('cells', {'cells': np.append(np.zeros(300_000), -2)[:, None]}),
        ('resolution', {'resolution': 0.0}),
        ('resolution', {'resolution': 1e-7}),
        ('resolution', {'resolution': math.nan}),
        ('origin', {'origin': Pose2D(math.inf, 0.0)}),
        ('origin', {'origin': Pose2D(0.0, -1e300)}),
        ('frame_id', {'frame_id': ''}),
    ],
)
def test_a_malformed_field_is_named(field, arguments):
    with pytest.raises(GridMapError) as error:
        GridMap(**{'cells': CELLS, **arguments})
    assert error.value.field == field


def test_a_point_that_is_not_finite_has_no_cell():
    with pytest.raises(GridMapError, match='finite'):
        GridMap(CELLS).world_to_cell(math.nan, 0.0)


@pytest.mark.parametrize('value', [1e12, 1e300, -1.7e308])
def test_a_point_at_any_distance_has_a_cell_off_the_map(value):
    grid_map = GridMap(np.zeros((4, 5), dtype=np.int8), 0.05, Pose2D(1.0, 2.0, 0.7))
    assert not grid_map.contains(grid_map.world_to_cell(value, -value))
