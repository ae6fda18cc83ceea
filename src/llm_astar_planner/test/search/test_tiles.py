"""Components by tiles: the same partition as scipy's, from nothing and after any changes."""

import numpy as np
import pytest
from grids import held_bytes
from hypothesis import given
from hypothesis import strategies as st
from llm_astar_planner.search.tiles import Tiles
from scipy import ndimage

ARRAYS = ('labels', 'counts', 'nodes', 'starts', 'contacts', 'components')


def arrays(tiles):
    return {**tiles.tables._asdict(), 'components': tiles.components}


def assert_partition(tiles, blocked):
    """The tiles part the free cells as scipy does."""
    neighbours = np.ones((3, 3)) if tiles.tables.corner_cutting else None
    expected, _ = ndimage.label(~blocked, structure=neighbours)
    found = tiles[:, :]
    assert ((found == 0) == blocked).all()
    pairs = np.unique(np.stack([expected, found], axis=-1)[~blocked], axis=0)
    assert len(np.unique(pairs[:, 0])) == len(np.unique(pairs[:, 1])) == len(pairs)


def random_grid(random, height, width):
    """Noise of any density, or corridors with walls of one cell."""
    blocked = random.random((height, width)) < random.choice([0.0, 0.2, 0.4, 0.5, 0.7, 1.0])
    if random.random() < 0.3:
        blocked[1::2] = True
        blocked[1::2, random.integers(width)] = False
    return blocked


@given(
    seed=st.integers(0, 2**32 - 1),
    height=st.integers(1, 90),
    width=st.integers(1, 90),
    shift=st.sampled_from([None, 2, 3, 4]),
    corner_cutting=st.booleans(),
)
def test_any_grid_is_parted_as_by_scipy(seed, height, width, shift, corner_cutting):
    blocked = random_grid(np.random.default_rng(seed), height, width)
    assert_partition(Tiles.build(blocked, shift, corner_cutting=corner_cutting), blocked)


@pytest.mark.parametrize('corner_cutting', [False, True])
@pytest.mark.parametrize('shift', [2, 3, 4])
def test_the_most_components_that_a_tile_can_have_are_told_apart(shift, corner_cutting):
    step = 2 if corner_cutting else 1
    y, x = np.ogrid[:70, :70]
    blocked = (x % 2 > 0) | (y % 2 > 0) if step == 2 else (x + y) % 2 > 0
    tiles = Tiles.build(blocked, shift, corner_cutting=corner_cutting)
    assert_partition(tiles, blocked)
    assert len(np.unique(tiles[:, :])) == 1 + (~blocked).sum()


@pytest.mark.parametrize('corner_cutting', [False, True])
@pytest.mark.parametrize('shift', [2, 3, 4])
def test_updates_equal_tiles_from_nothing_and_leave_the_old_ones_alone(shift, corner_cutting):
    random = np.random.default_rng(shift)
    height, width = 61, 83
    blocked = random.random((height, width)) < 0.45
    tiles = Tiles.build(blocked, shift, corner_cutting=corner_cutting)
    for _ in range(150):
        before, changed = tiles, blocked.copy()
        kept = {name: arrays(before)[name].copy() for name in ARRAYS}
        windows = []
        for _ in range(random.integers(0, 4)):
            top, left = random.integers(0, (height, width))
            bottom = random.integers(top, min(top + 20, height) + 1)
            right = random.integers(left, min(left + 20, width) + 1)
            windows.append((top, bottom, left, right))
            size = changed[top:bottom, left:right].shape
            changed[top:bottom, left:right] = random.random(size) < random.random()
        tiles, blocked = before.updated(changed, np.array(windows)), changed
        fresh = Tiles.build(blocked, shift, corner_cutting=corner_cutting)
        for name in ARRAYS:
            np.testing.assert_array_equal(arrays(tiles)[name], arrays(fresh)[name])
            np.testing.assert_array_equal(arrays(before)[name], kept[name])
    assert_partition(tiles, blocked)


def test_cells_arrays_and_slices_give_the_same_numbers():
    random = np.random.default_rng(1)
    blocked = random.random((30, 41)) < 0.4
    tiles = Tiles.build(blocked)
    whole = tiles[:, :]
    assert whole.dtype == np.int32
    y, x = random.integers(0, 30, 50), random.integers(0, 41, 50)
    np.testing.assert_array_equal(tiles[y, x], whole[y, x])
    np.testing.assert_array_equal(tiles[3:17, 5:40], whole[3:17, 5:40])
    assert tiles[7:7, 3:9].shape == (0, 6)
    assert all(tiles[int(row), int(column)] == whole[row, column] for row, column in zip(y, x))


@pytest.mark.parametrize(
    ('longer', 'shift'), [(51, 2), (256, 2), (257, 3), (512, 3), (513, 4), (20000, 4)]
)
def test_the_side_of_a_tile_grows_with_the_map(longer, shift):
    assert Tiles.build(np.zeros((2, longer), dtype=bool)).tables.shift == shift


def test_memory_is_less_than_two_bytes_a_cell():
    blocked = np.random.default_rng(1).random((1024, 1024)) < 0.2
    assert held_bytes(Tiles.build(blocked)) < 1.7 * blocked.size


def test_wrong_shapes_are_refused():
    for wrong in (np.zeros((0, 3), dtype=bool), np.zeros(3, dtype=bool)):
        with pytest.raises(ValueError, match='shape'):
            Tiles.build(wrong)
    with pytest.raises(ValueError, match='shape'):
        Tiles.build(np.zeros((5, 5), dtype=bool)).updated(np.zeros((5, 6), dtype=bool), [])
