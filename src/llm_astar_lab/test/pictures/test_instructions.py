"""Pictures show what the verification measured: regions, violations, visits."""

import numpy as np
import pytest
import shapely
from llm_astar_lab.pictures.figures import Picture, save_picture
from llm_astar_lab.pictures.instructed import InstructedPath
from llm_astar_lab.pictures.instructions import add_instruction_legend, draw_instruction
from llm_astar_msgs_adapter.maps.grid_map import GridMap, Pose2D
from llm_astar_msgs_adapter.maps.places import Place, Places
from llm_astar_planner.costmap.costmap import Costmap
from llm_astar_planner.instructions.clauses.avoid import Avoid
from llm_astar_planner.instructions.clauses.before import Before
from llm_astar_planner.instructions.clauses.end_at import EndAt
from llm_astar_planner.instructions.clauses.keep_distance import KeepDistance
from llm_astar_planner.instructions.clauses.pass_by import Pass
from llm_astar_planner.instructions.clauses.stay_in import StayIn
from llm_astar_planner.instructions.clauses.unknown import Unknown
from llm_astar_planner.instructions.clauses.visit import Visit
from llm_astar_planner.instructions.interpretation import Interpretation, status_of
from llm_astar_planner.instructions.outcome import InstructionOutcome
from llm_astar_planner.instructions.regions import Along, Between, Disc, Half, NamedPlace, Tagged
from llm_astar_planner.instructions.route import Route
from llm_astar_planner.instructions.specification import Specification
from llm_astar_planner.instructions.verification.verify import verify
from matplotlib.figure import Figure

LAB, DOCK, RACK = NamedPlace('lab'), NamedPlace('dock'), NamedPlace('rack')
PLACES = Places(
    [
        Place('lab', shapely.box(8, 0, 12, 6), tags=('blue',)),
        Place('dock', shapely.box(14, 6, 19, 9), tags=('blue',)),
        Place('rack', shapely.box(4, 7, 6, 8), 'object'),
        Place(r'$\frac{ $', shapely.box(1, 1, 2, 2)),
    ]
)
# From west to east through the lab, in metres.
POINTS = np.array([[1.0, 3.0], [13.0, 3.0], [19.0, 7.5]])


def grid():
    cells = np.zeros((20, 40), dtype=np.int8)
    cells[[0, -1], :] = cells[:, [0, -1]] = 100
    cells[14:16, 8:12] = 100
    return GridMap(cells, 0.5, Pose2D(0.0, 0.0))


def instructed(*clauses):
    grid_map = grid()
    start, goal = (grid_map.world_to_cell(*point) for point in POINTS[[0, -1]])
    route = Route(Costmap(grid_map), start, goal, PLACES)
    specification = Specification(clauses)
    interpretation = Interpretation(
        'some words', specification, 'grammar', status_of(specification)
    )
    outcome = InstructionOutcome(interpretation, verify(specification, POINTS, route))
    return InstructedPath(outcome, route, POINTS)


def length(path):
    (outcome,) = path.outcome.clauses
    parts = [shapely.LineString(points) for points in path.violating_parts(outcome)]
    return sum(part.length for part in parts)


@pytest.mark.parametrize(
    ('clause', 'metres'),
    [
        (Avoid(region=LAB), 4.0),
        (Avoid(region=LAB, margin=1.0), 6.0),
        (Avoid(region=NamedPlace('rack')), 0.0),
        (StayIn(region=LAB), shapely.LineString(POINTS).length - 4.0),
        (KeepDistance(metres=2.0, region=Disc(5.0, 3.0, 1.0)), 6.0),
    ],
)
def test_the_violating_part_of_the_path_is_what_was_measured(clause, metres):
    assert length(instructed(clause)) == pytest.approx(metres, abs=1e-3)


def test_the_path_near_walls_is_marked():
    path = instructed(KeepDistance(metres=3.0))
    (outcome,) = path.outcome.clauses
    marked = [shapely.LineString(points) for points in path.violating_parts(outcome)]
    walls = shapely.box(0, 0, 20, 10).exterior
    assert marked
    assert all(part.distance(walls) < 3.0 for part in marked)


def test_visits_are_marked_where_they_count():
    path = instructed(Visit(regions=(LAB,)), Visit(regions=(DOCK,)))
    points = [shapely.Point(point) for point in path.visited_points()]
    assert len(points) == 2
    for point, name in zip(points, ('lab', 'dock')):
        assert PLACES.get(name).geometry.contains(point)
    assert list(instructed(Visit(regions=(DOCK,)), Visit(regions=(LAB,))).visited_points()) == [
        pytest.approx((points[1].x, points[1].y))
    ]


EVERY_KIND = (
    Avoid(region=LAB),
    Avoid(region=Along('walls', 0.5)),
    Visit(regions=(Tagged('blue'), RACK)),
    Before(first=DOCK, second=LAB),
    StayIn(region=Half('north'), strength='should'),
    Pass(region=RACK, side='north'),
    KeepDistance(metres=0.4),
    KeepDistance(metres=1.0, region=RACK),
    EndAt(region=Between('lab', 'dock')),
    Visit(regions=(Disc(5, 5),), unsure='?'),
    Avoid(region=NamedPlace('nowhere')),
    Unknown(text=r'$\frac{ $ <b>'),
)


def test_every_kind_of_clause_is_drawn_with_a_line_in_the_legend(tmp_path):
    path = instructed(*EVERY_KIND)
    grid_map = grid()
    picture = Picture(
        grid_map, path.route.start, path.route.goal, np.array([path.route.start, path.route.goal]),
        np.zeros(grid_map.cells.shape, dtype=bool), (), r'$\frac{ $', (0, 0), PLACES, path,
    )  # fmt: skip
    save_picture(picture, tmp_path / 'every.png')
    assert (tmp_path / 'every.png').stat().st_size > 10_000
    figure = Figure(figsize=(8, 6))
    draw_instruction(figure.add_subplot(), path, picture.project)
    height = figure.get_figheight()
    add_instruction_legend(figure, path)
    (legend,) = figure.legends
    texts = [text.get_text().replace('\n', ' ') for text in legend.get_texts()]
    for clause in path.outcome.clauses:
        sentence = clause.to_json()['clause']
        assert any(text.startswith(sentence) for text in texts)
    assert figure.get_figheight() > height + 0.15 * len(EVERY_KIND)
