import os
from pathlib import Path

import numpy as np
import pytest
from llm_astar_msgs_adapter.maps.grid_map import Pose2D
from llm_astar_msgs_adapter.maps.map_server import MapServerError, load_map
from PIL import Image

FIELDS = {
    'image': 'x.png',
    'resolution': '0.05',
    'origin': '[-1.0, -2.0, 0.5]',
    'occupied_thresh': '0.65',
    'free_thresh': '0.25',
    'negate': '0',
}


def write(tmp_path, pixels, **fields):
    Image.fromarray(np.asarray(pixels, dtype=np.uint8)).save(tmp_path / 'x.png')
    lines = [f'{name}: {value}' for name, value in {**FIELDS, **fields}.items() if value != '']
    path = tmp_path / 'x.yaml'
    path.write_text('\n'.join(lines))
    return path


def test_trinary_mode_puts_the_bottom_row_of_the_image_first(tmp_path):
    grid = load_map(write(tmp_path, [[0, 255], [128, 254]]))
    assert grid.cells.tolist() == [[-1, 0], [100, 0]]
    assert grid.resolution == 0.05
    assert grid.origin == Pose2D(-1.0, -2.0, 0.5)


def test_negate_swaps_black_and_white(tmp_path):
    assert load_map(write(tmp_path, [[0, 255]], negate='1')).cells.tolist() == [[0, 100]]


def test_scale_mode_is_in_proportion_between_the_thresholds(tmp_path):
    shades = [[255, 191, 140, 90, 0]]
    assert load_map(write(tmp_path, shades)).cells.tolist() == [[0, -1, -1, -1, 100]]
    scaled = load_map(write(tmp_path, shades, mode='scale'))
    assert scaled.cells.tolist() == [[0, 0, 50, 99, 100]]


def test_transparent_pixels_are_unknown_in_scale_mode(tmp_path):
    pixels = [[[255, 255, 255, 255], [255, 255, 255, 10]]]
    assert load_map(write(tmp_path, pixels, mode='scale')).cells.tolist() == [[0, -1]]
    # In trinary mode alpha is one more colour: (3 * 205 + 10) / 4 is too dark to be free.
    pixels[0][1][:3] = [205, 205, 205]
    assert load_map(write(tmp_path, pixels)).cells.tolist() == [[0, -1]]


def test_raw_mode_is_the_shade_up_to_a_hundred(tmp_path):
    path = write(tmp_path, [[0, 65, 100, 101, 255]], mode='raw')
    assert load_map(path).cells.tolist() == [[0, 65, 100, -1, -1]]


@pytest.mark.parametrize(
    ('fields', 'message'),
    [
        ({'resolution': ''}, 'resolution: is missing'),
        ({'resolution': 'fine'}, "resolution: a number is expected, not 'fine'"),
        ({'resolution': '0.0'}, r'resolution: 0\.0 is not above'),
        ({'origin': '[0, 0]'}, 'origin:'),
        ({'origin': '[0, x, 0]'}, 'origin: a number'),
        ({'mode': 'binary'}, "mode: 'binary'"),
        ({'free_thresh': '0.7'}, r'free_thresh: 0\.7'),
        ({'negate': '2'}, 'negate: 0 or 1'),
        ({'image': 'none.png'}, r'image: .*none\.png'),
        ({'image': '7'}, 'image: a file name'),
        ({'image': 'x' * 3000}, 'image: .*xxx.*: File name too long'),
        ({'image': 'x.yaml'}, 'image: .* is not an image'),
    ],
)
def test_a_broken_field_is_named(tmp_path, fields, message):
    path = write(tmp_path, [[0, 255]], **fields)
    with pytest.raises(MapServerError, match=r'x\.yaml: ' + message):
        load_map(path)


def test_a_number_of_four_hundred_digits_is_named_and_not_quoted(tmp_path):
    with pytest.raises(
        MapServerError, match='resolution: a number is expected, not 1111'
    ) as error:
        load_map(write(tmp_path, [[0]], resolution='1' * 400))
    assert len(str(error.value)) < 300


@pytest.mark.parametrize('text', ['[1, 2', '- 1\n- 2', ''])
def test_a_file_that_is_not_a_map_is_named(tmp_path, text):
    path = tmp_path / 'bad.yaml'
    path.write_text(text)
    with pytest.raises(MapServerError, match=r'bad\.yaml'):
        load_map(path)


def test_the_map_of_a_robot_loads():
    folder = os.environ.get('LLM_ASTAR_REFERENCE')
    if not folder:
        pytest.skip('LLM_ASTAR_REFERENCE is not set')
    grid = load_map(Path(folder) / 'grids' / 'depot.yaml')
    assert set(np.unique(grid.cells).tolist()) <= {-1, 0, 100}
    assert (grid.cells == 0).any()
    assert grid.origin == Pose2D(-7.14, -7.83, 0.0)


def test_a_file_that_is_not_yaml_is_reported_in_one_line(tmp_path):
    (tmp_path / 'x.yaml').write_text('a: [1\nb: 2\n')
    with pytest.raises(MapServerError, match=r'x\.yaml: not yaml: ') as caught:
        load_map(tmp_path / 'x.yaml')
    assert '\n' not in str(caught.value)


def test_formats_that_start_other_programs_are_refused_whatever_their_name(tmp_path):
    path = write(tmp_path, [[0]])
    (tmp_path / 'x.png').write_bytes(b'%!PS-Adobe-3.0 EPSF-3.0\n%%BoundingBox: 0 0 9 9\n%%EOF\n')
    with pytest.raises(MapServerError, match='is not an image of PPM, PNG, BMP, JPEG'):
        load_map(path)


def test_an_image_that_would_take_too_much_memory_is_refused_unread(tmp_path):
    path = write(tmp_path, [[0]], image='x.pgm')
    (tmp_path / 'x.pgm').write_bytes(b'P5 13000 13000 255\n')
    with pytest.raises(MapServerError, match='is over 160000000 pixels'):
        load_map(path)


def test_an_image_that_is_no_regular_file_is_refused(tmp_path):
    os.mkfifo(tmp_path / 'pipe')
    with pytest.raises(MapServerError, match='is not a regular file'):
        load_map(write(tmp_path, [[0]], image='pipe'))


def test_strips_of_a_large_image_are_put_together(tmp_path, monkeypatch):
    pixels = np.random.default_rng(1).integers(0, 256, (50, 7), dtype=np.uint8)
    whole = load_map(write(tmp_path, pixels)).cells
    monkeypatch.setattr('llm_astar_msgs_adapter.maps.map_server.STRIP_PIXELS', 20)
    assert (load_map(write(tmp_path, pixels)).cells == whole).all()
