"""What a picture of a plan shows."""

import numpy as np
import pytest
from llm_astar_lab.pictures import style
from llm_astar_lab.pictures.figures import draw, picture_of, save_picture, write_labels
from llm_astar_msgs_adapter.maps.grid_map import GridMap, Pose2D
from llm_astar_planner.costmap.config import CostmapConfig
from llm_astar_planner.costmap.costmap import Costmap
from llm_astar_planner.planning.footprint import Footprint
from llm_astar_planner.planning.planner import Planner
from llm_astar_planner.planning.types import PlanRequest
from llm_astar_planner.waypoints.replay import FixedReply
from matplotlib.collections import PolyCollection
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from mpl_toolkits.axes_grid1.anchored_artists import AnchoredSizeBar
from PIL import Image

MAP = GridMap(np.zeros((40, 60), np.int8), 0.1)
# A metre a cell: its axes are in cells.
CELLS = GridMap(np.zeros((40, 60), np.int8))


def outlines_of(plan, grid_map=MAP, offset=(0, 0)):
    """The corners of each outline that is drawn for a plan."""
    axes = Figure().add_subplot()
    draw(axes, picture_of(plan, Costmap(grid_map), offset))
    drawn = [item for item in axes.collections if isinstance(item, PolyCollection)]
    return [path.vertices[:-1] for item in drawn for path in item.get_paths()]


def test_the_robots_outline_is_drawn_along_the_path_in_its_direction():
    footprint = Footprint(((0.5, 0.1), (0.5, -0.1), (-0.2, -0.1), (-0.2, 0.1)))
    planner = Planner(MAP)
    outlines = outlines_of(planner.plan(PlanRequest((20, 8), (20, 33), footprint=footprint)))
    assert len(outlines) >= 3
    # In metres, of a map whose cell (20, 8) is at 2.05, 0.85. It looks up: what is ahead of the
    # robot is above the start.
    assert np.allclose(outlines[0], [(1.95, 1.35), (2.15, 1.35), (2.15, 0.65), (1.95, 0.65)])
    assert outlines_of(planner.plan(PlanRequest((20, 8), (20, 33)))) == []
    wide = Footprint(((5.0, 1.0), (5.0, -1.0), (-2.0, -1.0), (-2.0, 1.0)))
    plan = Planner(CELLS).plan(PlanRequest((20, 8), (20, 33), footprint=wide))
    moved = outlines_of(plan, CELLS, (100, 7))
    assert np.allclose(moved[0], [(119, 20), (121, 20), (121, 13), (119, 13)])


def drawn_texts(path, **options):
    """The picture of a plan saved to a file, and the words on it by what they are."""
    rooms = np.zeros((40, 60), np.int8)
    rooms[18:22, 20:40] = 100
    costmap = Costmap(GridMap(rooms, 0.1, Pose2D(-1.0, 2.0)), CostmapConfig(robot_radius=0.25))
    planner = Planner(costmap.grid_map, costmap.config)
    plan = planner.plan(PlanRequest((30, 5), (30, 35), **options))
    picture = picture_of(plan, costmap)
    figures = []
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Figure, 'savefig', lambda self, *_, **__: figures.append(self))
        save_picture(picture, path)
    (figure,) = figures
    return plan, figure, figure.axes[0]


def test_a_robot_map_has_axes_in_metres_a_scale_bar_and_its_inflated_zone(tmp_path):
    plan, figure, axes = drawn_texts(tmp_path / 'a.png')
    assert (axes.get_xlabel(), axes.get_ylabel()) == ('x (m)', 'y (m)')
    assert np.allclose([*axes.get_xlim(), *axes.get_ylim()], [-1.0, 5.0, 2.0, 6.0])
    (bar,) = [artist for artist in axes.artists if isinstance(artist, AnchoredSizeBar)]
    assert bar.txt_label.get_text() == '1 m'
    names = [text.get_text() for text in figure.legends[0].get_texts()]
    assert {'start', 'goal', 'path', 'obstacle', 'inflated zone'} <= set(names)
    assert f'{0.1 * plan.length:.2f} m' in axes.get_title()
    assert f'{plan.expansions} expansions' in axes.get_title()
    zone = np.array(to_rgb(style.INFLATED)) * 255
    assert (axes.images[0].get_array() == zone.round()).all(axis=2).any()


def test_no_label_hides_a_mark_or_another_label(tmp_path):
    reply = FixedReply('[[31, 6], [31, 5], [32, 6], [15, 20], [29, 35], [31, 36]]')
    _, _, axes = drawn_texts(tmp_path / 'a.png', source=reply)
    labels = [text.get_window_extent() for text in axes.texts if text.get_text().isdigit()]
    assert len(labels) == 6
    marks = [line for line in axes.lines if line.get_label().startswith(('start', 'goal', 'way'))]
    points = np.concatenate([axes.transData.transform(line.get_xydata()) for line in marks])
    assert len(points) == 8
    for number, box in enumerate(labels):
        assert not any(box.contains(x, y) for x, y in points)
        assert not any(box.overlaps(other) for other in labels[:number])


@pytest.mark.parametrize('start', [(20, 8), (-700, 3)])
def test_what_is_off_the_map_does_not_change_the_size_of_its_picture(tmp_path, start):
    plan = Planner(MAP).plan(PlanRequest(start, (90_000, 6), via=((5, -400),)))
    save_picture(picture_of(plan, Costmap(MAP)), tmp_path / 'off.png')
    with Image.open(tmp_path / 'off.png') as picture:
        assert max(picture.size) < 2000


def test_what_closes_the_way_is_marked_where_it_is():
    cells = np.zeros((40, 40), dtype=np.int8)
    cells[:, 20], cells[17:24, 20] = 100, 0
    planner = Planner(GridMap(cells, 0.1), CostmapConfig(robot_radius=0.45))
    plan = planner.plan(PlanRequest((5, 20), (35, 20)))
    axes = Figure().add_subplot()
    draw(axes, picture_of(plan, planner.costmap))
    (mark,) = (line for line in axes.get_lines() if line.get_label() == 'closes the way')
    assert [*mark.get_xdata(), *mark.get_ydata()] == pytest.approx([2.05, 2.05])


def test_each_way_to_choose_is_drawn_wider_than_the_path_and_named():
    cells = np.zeros((30, 60), dtype=np.int8)
    cells[10:22, 25:35] = 100
    planner = Planner(GridMap(cells))
    plan = planner.plan(PlanRequest((3, 15), (56, 15), alternatives=2))
    figure = Figure(layout='constrained')
    axes = figure.add_subplot()
    picture = picture_of(plan, planner.costmap)
    draw(axes, picture)
    lines = {line.get_label(): line for line in axes.lines}
    for name in ('way 1', 'way 2'):
        assert lines[name].get_linewidth() > 2 * lines['path'].get_linewidth()
    write_labels(axes, picture)
    assert {'way 1', 'way 2'} <= {text.get_text() for text in axes.texts}
