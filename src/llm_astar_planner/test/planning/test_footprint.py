"""The robot's polygon: what is refused, its radii, and collisions held against shapely."""

import math

import numpy as np
import pytest
import shapely
from llm_astar_msgs_adapter.maps.grid_map import GridMap, Pose2D
from llm_astar_planner.costmap.config import CostmapConfig
from llm_astar_planner.costmap.costmap import Costmap
from llm_astar_planner.parameter import problem_of
from llm_astar_planner.planning.footprint import Footprint, FootprintError
from llm_astar_planner.planning.footprint_search import FootprintChecker
from shapely import affinity

RECTANGLE = '[[0.5, 0.2], [0.5, -0.2], [-0.5, -0.2], [-0.5, 0.2]]'
# A fork lift: the gap between the forks is no part of the robot.
FORK = (
    (-0.5, -0.4),
    (0.6, -0.4),
    (0.6, -0.2),
    (0.0, -0.2),
    (0.0, 0.2),
    (0.6, 0.2),
    (0.6, 0.4),
    (-0.5, 0.4),
)


def checker_of(cells, footprint, **rules) -> FootprintChecker:
    """A checker on cells of 0.1 m."""
    costmap = Costmap(GridMap(np.array(cells, np.int8), 0.1), CostmapConfig(**rules))
    return FootprintChecker(costmap, footprint)


def shapely_collides(grid_map, footprint, pose, threshold, *, unknown_blocks) -> bool:
    """The same question to shapely, cell by cell."""
    turned = affinity.rotate(shapely.Polygon(footprint.points), pose[2], (0, 0), use_radians=True)
    polygon = affinity.translate(turned, pose[0], pose[1])
    height, width = grid_map.cells.shape
    corners = grid_map.grid_to_world(
        [(-0.5, -0.5), (width - 0.5, -0.5), (width - 0.5, height - 0.5), (-0.5, height - 0.5)]
    )
    if not shapely.Polygon(corners).contains(polygon):
        return True
    lethal = grid_map.cells >= threshold
    if unknown_blocks:
        lethal |= grid_map.cells < 0
    for y, x in np.argwhere(lethal):
        square = [(x - 0.5, y - 0.5), (x + 0.5, y - 0.5), (x + 0.5, y + 0.5), (x - 0.5, y + 0.5)]
        if polygon.intersects(shapely.Polygon(grid_map.grid_to_world(square))):
            return True
    return False


@pytest.mark.parametrize('seed', range(8))
def test_collisions_are_those_that_shapely_finds(seed):
    rng = np.random.default_rng(seed)
    cells = (rng.random((60, 80)) < 0.003).astype(np.int8) * 100
    cells[rng.random((60, 80)) < 0.02] = -1
    origin = Pose2D(*rng.uniform(-3, 3, 2), rng.uniform(-3, 3))
    grid_map = GridMap(cells, 0.1, origin)
    allow_unknown = bool(seed % 2)
    config = CostmapConfig(allow_unknown=allow_unknown)
    # A star-shaped polygon: it cannot meet itself.
    count = rng.integers(3, 9)
    angles = (np.arange(count) + rng.uniform(0, 0.4, count)) * 2 * math.pi / count
    radii = rng.uniform(0.05, 0.6, count)
    star = np.column_stack([np.cos(angles) * radii, np.sin(angles) * radii])
    for footprint in (Footprint.of(star), Footprint(FORK), Footprint.parse(RECTANGLE)):
        places = grid_map.grid_to_world(rng.uniform((0, 0), (80, 60), (60, 2)))
        poses = np.column_stack([places, rng.uniform(-4, 4, 60)])
        expected = [
            shapely_collides(grid_map, footprint, pose, 65, unknown_blocks=not allow_unknown)
            for pose in poses
        ]
        checker = FootprintChecker(Costmap(grid_map, config), footprint)
        assert checker.collisions(poses).tolist() == expected
        assert 0 < sum(expected) < 60


def test_an_obstacle_inside_of_the_outline_is_a_collision():
    cells = np.zeros((40, 40))
    cells[20, 20] = 100
    checker = checker_of(cells, Footprint.parse('[[1, 1], [1, -1], [-1, -1], [-1, 1]]'))
    assert checker.collisions([(2.05, 2.05, 0.3)]).all()


def test_the_gap_of_a_concave_robot_is_free():
    cells = np.zeros((40, 40))
    cells[20, 23] = 100
    place = (2.0, 2.05)
    checker = checker_of(cells, Footprint(FORK))
    assert checker.collisions([(*place, 0.0), (*place, math.pi), (*place, 0.8)]).tolist() == [
        False, True, True,
    ]  # fmt: skip


def test_inscribed_cells_of_a_costmap_are_no_obstacles_but_lethal_ones_are():
    cells = np.zeros((40, 40))
    cells[20, 20] = 99
    footprint = Footprint.parse(RECTANGLE)
    pose = [(2.05, 2.05, 0.0)]
    assert not checker_of(cells, footprint, occupied_threshold=99).collisions(pose).any()
    assert checker_of(cells, footprint, occupied_threshold=65).collisions(pose).all()
    cells[20, 20] = 100
    assert checker_of(cells, footprint, occupied_threshold=99).collisions(pose).all()


def test_unknown_cells_are_obstacles_as_the_costmap_or_the_caller_says():
    costmap = Costmap(GridMap(np.full((40, 40), -1, np.int8), 0.1))
    footprint, pose = Footprint.parse(RECTANGLE), [(2.0, 2.0, 0.0)]
    assert not FootprintChecker(costmap, footprint).collisions(pose).any()
    strict = FootprintChecker(costmap, footprint, allow_unknown=False)
    assert strict.collisions(pose).all()


@pytest.mark.parametrize(
    'pose', [(0.3, 2, 0), (3.6, 2, 0), (2, 0.1, 0), (2, 3.85, 0), (2, 0.4, 1.6)]
)
def test_a_polygon_that_leaves_the_map_collides(pose):
    checker = checker_of(np.zeros((40, 40)), Footprint.parse(RECTANGLE))
    assert checker.collisions([(2, 2, 0), pose]).tolist() == [False, True]


@pytest.mark.parametrize(
    'pose', [(math.nan, 2, 0), (2, math.inf, 0), (2, 2, math.nan), (1e300, 2, 0)]
)
def test_a_pose_that_is_not_finite_or_far_away_collides(pose):
    checker = checker_of(np.zeros((40, 40)), Footprint.parse(RECTANGLE))
    with np.errstate(invalid='ignore'):
        assert checker.collisions([pose]).all()


def test_the_radii_are_those_of_the_nearest_edge_and_the_farthest_point():
    footprint = Footprint.parse(RECTANGLE)
    assert footprint.inscribed_radius == pytest.approx(0.2)
    assert footprint.circumscribed_radius == pytest.approx(math.hypot(0.5, 0.2))
    rng = np.random.default_rng(1)
    for _ in range(50):
        points = rng.uniform(-1, 1, (3, 2))
        triangle = Footprint.of(points)
        polygon, origin = shapely.Polygon(points), shapely.Point(0, 0)
        inside = polygon.exterior.distance(origin) if polygon.contains(origin) else 0.0
        assert triangle.inscribed_radius == pytest.approx(inside)
        farthest = shapely.hausdorff_distance(origin, polygon)
        assert triangle.circumscribed_radius == pytest.approx(farthest)


@pytest.mark.parametrize('text', ['', ' ', '[]', '[ ]'])
def test_no_footprint_is_a_footprint_of_no_points(text):
    assert Footprint.parse(text) is None
    assert problem_of(Footprint.parse, text) is None


def test_nav2s_ways_to_write_a_footprint_are_read():
    points = ((1.0, 2.2), (0.3, -4.0), (-0.4, 0.0))
    assert Footprint.parse('[[1, 2.2], [.3, -4e0], [-.4 0]]').points == points
    assert Footprint.parse(' [[1.0,2.2],[0.3,-4.],[-0.4,+0.0]] ').points == points


@pytest.mark.parametrize(
    ('text', 'words'),
    [
        ('[[0, 0], [1, 0]]', '2 points; it needs 3 to 64'),
        ('[[]]', 'pair'),
        (str([[math.cos(n / 11), math.sin(n / 11)] for n in range(65)]), '65 points'),
        ('[[0, 0], [1, 0], [1, 1], [0.5, -1]]', 'its outline meets itself (Self-intersection'),
        ('[[0, 0], [2, 0], [2, 1], [1, 0], [0, 1]]', 'meet'),
        ('[[0, 0], [1, 0], [0.5, 0]]', 'meet'),
        ('[[0, 0], [1, 0], [0.5, 1e-9]]', 'no area'),
        ('[[0, 0], [1, 0], [1, 0], [0, 1]]', 'the same'),
        ('[[0, 0], [11, 0], [0, 1]]', 'point 2, (11.0, 0.0), is not within 10 m'),
        ('[[0, 0], [1e999, 0], [0, 1]]', 'point 2'),
        ('[[0, 0], [nan, 0], [0, 1]]', 'not of the form'),
        ('[[0, 0, 0], [1, 0, 0], [0, 1, 0]]', '[0, 0, 0] is not a pair'),
        ('[[0, 0], [1, 0], [0, --1]]', '[0, --1] is not a pair'),
        ('[[0, 0], [1, 0], [0, 1]', 'not of the form'),
        ('[0, 0, 1, 0, 0, 1]', 'not of the form'),
        ('circle', 'not of the form'),
        ('[' * 4000, 'not of the form'),
        ('[[1,1],' * 2000, 'characters'),
    ],
)
def test_what_is_no_footprint_is_refused_with_the_reason(text, words):
    assert words in problem_of(Footprint.parse, text)


@pytest.mark.parametrize('seed', range(20))
def test_an_outline_is_refused_where_shapely_calls_it_invalid(seed):
    rng = np.random.default_rng(seed)
    for _ in range(20):
        # Whole numbers, so that points lie on edges and edges on each other.
        points = rng.integers(-2, 3, (rng.integers(3, 7), 2)).astype(float)
        polygon = shapely.Polygon(points)
        repeats = (points == np.roll(points, 1, 0)).all(axis=1).any()
        try:
            Footprint.of(points)
        except FootprintError:
            assert repeats or not polygon.is_valid
        else:
            assert polygon.is_valid
            assert not repeats
