import numpy as np
import pytest
import shapely
from llm_astar_msgs_adapter.maps.grid_map import GridMap, Pose2D
from llm_astar_planner.costmap.raster import STEPS, cover, open_border

WIDTH, HEIGHT = 17, 13


def random_polygon(random, middle, resolution):
    kind = random.integers(0, 4)
    if kind == 0:
        return shapely.Point(middle).buffer(resolution * random.uniform(0.2, 9))
    if kind == 1:
        points = middle + resolution * random.uniform(-11, 11, (6, 2))
        return shapely.convex_hull(shapely.MultiPoint(points))
    if kind == 2:
        low, high = (resolution * random.integers(1, 18, 2) / 2 for _ in range(2))
        return shapely.box(*(middle - low), *(middle + high))
    outer, inner = (shapely.Point(middle).buffer(resolution * radius) for radius in (6, 3))
    return outer.difference(inner)


@pytest.mark.parametrize('seed', range(40))
def test_cells_are_covered_as_shapely_says(seed):
    random = np.random.default_rng(seed)
    resolution = float(random.choice([1.0, 0.25, 0.05]))
    origin = Pose2D(*random.uniform(-3, 3, 2), random.choice([0.0, 0.5, -2.0]))
    grid_map = GridMap(np.zeros((HEIGHT, WIDTH), np.int8), resolution, origin)
    polygon = random_polygon(random, grid_map.grid_to_world([[8, 6]])[0], resolution)
    covered = cover(polygon, grid_map)
    corners = np.array([[-0.5, -0.5], [0.5, -0.5], [0.5, 0.5], [-0.5, 0.5]])
    for y in range(HEIGHT):
        for x in range(WIDTH):
            square = shapely.Polygon(grid_map.grid_to_world(corners + (x, y)))
            centre = shapely.Point(grid_map.grid_to_world([[x, y]])[0])
            area = square.intersection(polygon).area / resolution**2
            if abs(polygon.boundary.distance(centre)) > 1e-9:
                assert covered.centres[y, x] == polygon.contains(centre), (x, y)
            if not 1e-9 < area < 1e-6:
                assert covered.touched[y, x] == (area >= 1e-6), (x, y, area)


def test_several_polygons_and_none():
    grid_map = GridMap(np.zeros((4, 4), np.int8))
    two = shapely.MultiPolygon([shapely.box(0, 0, 1, 1), shapely.box(2, 2, 4, 4)])
    assert cover(two, grid_map).centres.sum() == 5
    assert not cover(shapely.Polygon(), grid_map).touched.any()


def test_a_polygon_that_only_shares_a_side_with_a_cell_does_not_touch_it():
    grid_map = GridMap(np.zeros((4, 4), np.int8))
    assert cover(shapely.box(1, 1, 2, 2), grid_map).touched.sum() == 1


@pytest.mark.parametrize('seed', range(20))
def test_no_move_beside_an_opened_border_crosses_the_geometry(seed):
    random = np.random.default_rng(seed)
    grid_map = GridMap(np.zeros((HEIGHT, WIDTH), np.int8), 1.0)
    polygon = random_polygon(random, np.array([8.0, 6.0]), 1.0)
    touched = cover(polygon, grid_map)
    opened = open_border(touched, polygon, grid_map)
    assert not (opened.touched & ~touched.touched).any()
    assert (opened.centres <= opened.touched).all()
    for y, x in np.argwhere(~opened.touched):
        for step_x, step_y in STEPS:
            end = (x + step_x, y + step_y)
            if grid_map.contains(end) and not opened.touched[end[1], end[0]]:
                move = shapely.LineString(grid_map.grid_to_world([(x, y), end]))
                assert move.intersection(polygon).length < 1e-6


def test_cells_are_left_open_beside_a_border_that_no_move_crosses():
    grid_map = GridMap(np.zeros((5, 5), np.int8))
    box = shapely.box(2.2, 0, 5, 5)  # 0.3 m of the cells of column 2 lie in front of it
    assert cover(box, grid_map).touched[:, 2].all()
    assert not cover(shapely.box(2.6, 0, 5, 5), grid_map).centres[:, 2].any()
    opened = open_border(
        cover(shapely.box(2.6, 0, 5, 5), grid_map), shapely.box(2.6, 0, 5, 5), grid_map
    )
    assert not opened.touched[:, 2].any()
