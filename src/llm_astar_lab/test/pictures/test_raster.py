"""Maps become images that lose no obstacle and show where something happens."""

import numpy as np
from llm_astar_lab.pictures import raster
from llm_astar_msgs_adapter.maps.grid_map import GridMap

NOTHING = np.zeros((0, 0), dtype=bool)


def test_obstacles_cover_the_inflated_zone_which_covers_expanded_cells():
    cells = np.array([[100, 0, 0, 0, -1]], dtype=np.int8)
    expanded = np.array([[True, True, True, False, False]])
    inflated = np.array([[True, True, False, False, True]])
    codes = raster.cell_codes(GridMap(cells), expanded, inflated)
    shown = (raster.OBSTACLE, raster.INFLATED, raster.EXPANDED, raster.OPEN, raster.UNKNOWN)
    assert codes.tolist() == [list(shown)]


def test_a_wall_of_one_cell_survives_any_size():
    codes = np.zeros((300, 400), dtype=np.uint8)
    codes[:, 137] = raster.OBSTACLE
    for width, height in ((40, 30), (401, 299), (133, 7), (900, 700)):
        small = raster.resize(codes, width, height)
        assert small.shape == (height, width)
        assert (small.max(axis=1) == raster.OBSTACLE).all()


def test_a_large_map_is_cropped_to_where_something_happens():
    codes = np.full((400, 600), raster.UNKNOWN, dtype=np.uint8)
    codes[50:350, 100:500] = raster.OPEN
    points = np.array([(200.0, 100.0), (260.0, 140.0)])
    window = raster.choose_window(codes, points)
    assert window.left <= 200 - 5
    assert window.right >= 260 + 6
    assert window.width < 120
    # What the search expanded belongs to it, and the unknown margin of a map never does.
    codes[60:340, 110:490] = raster.EXPANDED
    assert raster.choose_window(codes, points) == (99, 49, 501, 351)
    # A small map is drawn whole.
    assert raster.choose_window(codes[300:400, :140], np.array([(110.0, 20.0)])).width >= 40


def test_single_expanded_cells_are_drawn_large_enough_to_be_seen():
    codes = np.zeros((20, 20), dtype=np.uint8)
    codes[10, 10], codes[10, 11] = raster.EXPANDED, raster.OBSTACLE
    wide = raster.widen_expanded(codes, 3)
    assert (wide == raster.EXPANDED).sum() == 8
    assert wide[10, 11] == raster.OBSTACLE
    assert raster.widen_expanded(codes, 1) is codes
