"""Map updates: applied where they fit the map, refused with the field where they do not."""

import array
from types import SimpleNamespace

import numpy as np
import pytest
from llm_astar_msgs_adapter.maps.grid_map import GridMap, GridMapError, Pose2D
from llm_astar_msgs_adapter.messages.fields import is_outdated, updated

MAP = GridMap(np.zeros((4, 6), dtype=np.int8), 0.05, Pose2D(1.0, -2.0, 0.3), 'map')


def update(x=1, y=2, width=3, height=2, data=None, frame_id='map'):
    cells = [100, -1, 50, 0, 1, 2] if data is None else data
    header = SimpleNamespace(frame_id=frame_id)
    return SimpleNamespace(
        header=header, x=x, y=y, width=width, height=height, data=array.array('b', cells)
    )


def test_an_update_changes_its_rectangle_and_nothing_else():
    after = updated(MAP, update())
    assert after.cells[2:4, 1:4].tolist() == [[100, -1, 50], [0, 1, 2]]
    assert np.count_nonzero(after.cells) == 5
    assert np.count_nonzero(MAP.cells) == 0
    assert (after.resolution, after.origin, after.frame_id) == (0.05, MAP.origin, 'map')
    assert after.digest != MAP.digest
    assert not after.cells.flags.writeable


@pytest.mark.parametrize(
    ('sent', 'map_time', 'outdated'),
    [
        ((5, 1), 5_000_000_002, True),
        ((5, 2), 5_000_000_002, False),
        ((0, 0), 5, False),
        ((5, 0), 3_600_000_000_000, False),  # the clock was set back by an hour
    ],
)
def test_an_update_older_than_the_whole_map_is_outdated(sent, map_time, outdated):
    stamp = SimpleNamespace(sec=sent[0], nanosec=sent[1])
    assert is_outdated(SimpleNamespace(header=SimpleNamespace(stamp=stamp)), map_time) == outdated


def test_an_empty_frame_means_the_maps():
    assert updated(MAP, update(frame_id='')).digest == updated(MAP, update()).digest


@pytest.mark.parametrize(
    ('changes', 'field', 'words'),
    [
        ({'frame_id': 'odom'}, 'header.frame_id', "'odom' is not the frame of the map, 'map'"),
        ({'x': 4}, 'x, y, width, height', '3 x 2 cells from (4, 2) do not lie on a map of 6 x 4'),
        ({'y': -1}, 'x, y, width, height', 'from (1, -1)'),
        ({'width': 0, 'data': []}, 'x, y, width, height', '0 x 2 cells'),
        ({'data': [0] * 5}, 'data', '5 cells do not fill 3 x 2'),
        ({'data': [0, 0, 0, 0, 0, 101]}, 'data', '-1, 0 to 100'),
        ({'data': [0, 0, 0, 0, 0, -2]}, 'data', '-1, 0 to 100'),
    ],
)
def test_an_update_that_does_not_fit_is_refused_with_the_field(changes, field, words):
    with pytest.raises(GridMapError) as caught:
        updated(MAP, update(**changes))
    assert caught.value.field == field
    assert words in str(caught.value)
