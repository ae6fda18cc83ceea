"""`llm-astar draw` and the figures show what was really searched."""

import numpy as np
import pytest
from llm_astar_lab.pictures import style
from llm_astar_lab.pictures.figures import Picture, draw
from llm_astar_msgs_adapter.maps.grid_map import GridMap
from llm_astar_planner.cli import main as cli
from matplotlib.figure import Figure
from PIL import Image, ImageColor

ROBOT_MAP = """image: hall.pgm
resolution: 0.1
origin: [-2.0, 1.0, 0.0]
negate: 0
occupied_thresh: 0.65
free_thresh: 0.196
"""


@pytest.mark.parametrize('name', ['a.png', 'deep/a.gif'])
def test_the_ending_chooses_picture_or_animation(tmp_path, name, capsys):
    path = tmp_path / name
    assert cli.main(['draw', '--map-id', '5', '--pair', '3', '--out', str(path)]) == 0
    assert path.stat().st_size > 1000
    assert capsys.readouterr().out == f'{path}\n'


def test_a_robot_map_is_animated_with_guided_beside_astar(tmp_path):
    shades = np.full((60, 120), 254, dtype=np.uint8)
    shades[[0, -1]] = shades[:, [0, -1]] = shades[20:, 40:44] = shades[:40, 80:84] = 0
    Image.fromarray(shades).save(tmp_path / 'hall.pgm')
    (tmp_path / 'hall.yaml').write_text(ROBOT_MAP)
    where = ['--map', str(tmp_path / 'hall.yaml'), '--start', '-1', '2', '--goal', '9', '6']
    path = tmp_path / 'a.gif'
    options = ['--robot-radius', '0.2', '--source', 'coarse', '--out', str(path)]
    assert cli.main(['draw', *where, *options]) == 0
    assert path.stat().st_size < 200_000
    with Image.open(path) as image:
        assert image.n_frames > 30
        assert image.size[0] == 880
        amber = []
        for frame in (0, image.n_frames - 1):
            image.seek(frame)
            cells = np.array(image.convert('RGB')) == ImageColor.getrgb(style.EXPANDED)
            halves = np.split(cells.all(axis=2)[: image.height * 2 // 3], 2, axis=1)
            amber.append([int(half.sum()) for half in halves])
        assert image.info['duration'] >= 3000
    # Nothing is expanded at first; at the end A* has expanded far more than `guided`.
    assert max(amber[0]) < 30
    assert amber[1][0] > 5 * amber[1][1]


@pytest.mark.parametrize(
    ('words', 'part'),
    [
        (['--pair', '99', '--out', 'a.png'], '--pair 99: map 0 has 10 pairs'),
        (['--map-id', '999', '--out', 'a.png'], 'map id 999'),
        (['--source', 'tea', '--out', 'a.png'], "'tea' is not one of"),
        (['--out', 'a.nothing'], 'nothing'),
        (['--instruction', 'avoid the lab', '--out', 'a.gif'], '--instruction'),
        (['--map', 'gone.yaml', '--out', 'a.gif'], 'gone.yaml'),
    ],
)
def test_bad_usage_is_one_line(words, part, capsys, monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv('MPLBACKEND', 'agg')
    assert cli.main(['draw', *words]) == 2
    error = capsys.readouterr().err
    assert part in error
    assert error.count('\n') == 1
    assert list(tmp_path.iterdir()) == []


def test_no_path_is_said_and_nothing_is_drawn(tmp_path, capsys):
    path = tmp_path / 'a.png'
    ends = ['--map', 'demo.json', '--start', '5', '5', '--goal', '0', '0', '--tolerance', '0']
    assert cli.main(['draw', *ends, '--out', str(path)]) == 1
    assert 'GOAL_OCCUPIED 206' in capsys.readouterr().out
    assert not path.exists()


def test_a_title_is_never_wider_than_its_picture(tmp_path):
    grid_map = GridMap(np.zeros((12, 12), dtype=np.int8))
    nothing = np.zeros(grid_map.cells.shape, dtype=bool)
    title = 'guided, guided by a model with quite a long name for itself: 49 expansions, ' * 3
    path = np.empty((0, 2), dtype=np.int32)
    picture = Picture(grid_map, (1, 1), (9, 9), path, nothing, (), title)
    figure = Figure(figsize=(7.0, 6.0), layout='constrained')
    draw(figure.add_subplot(), picture)
    figure.savefig(tmp_path / 'a.png')
    box = figure.axes[0].title.get_window_extent()
    assert box.x0 >= 0.0
    assert box.x1 <= figure.bbox.width


@pytest.mark.parametrize('name', ['a.png', 'a.gif'])
def test_a_full_disk_is_an_error_that_names_the_file(tmp_path, name, capsys):
    path = tmp_path / name
    path.symlink_to('/dev/full')
    assert cli.main(['draw', '--map', 'demo.json', '--out', str(path)]) == 2
    assert f'{path}: No space left on device' in capsys.readouterr().err
