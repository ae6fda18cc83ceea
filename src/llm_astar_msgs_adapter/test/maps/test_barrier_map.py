import json

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from llm_astar_msgs_adapter.maps.barrier_map import (
    Barrier,
    BarrierMap,
    BarrierMapError,
    Sample,
    find_barrier_map,
    load_barrier_maps,
    parse_barrier_map,
)
from llm_astar_msgs_adapter.maps.problem_maps import save_maps

ENTRY = {
    'id': 3,
    'range_x': [0, 11],
    'range_y': [0, 9],
    'horizontal_barriers': [[4, 2, 6]],
    'vertical_barriers': [[8, 1, 5]],
    'start_goal': [[[1, 1], [9, 7], 'design a path']],
}


def write(tmp_path, data):
    path = tmp_path / 'maps.json'
    path.write_text(data if isinstance(data, str) else json.dumps(data))
    return path


def blocked(barrier_map):
    rows, columns = np.nonzero(barrier_map.to_grid().cells)
    return set(zip(columns.tolist(), rows.tolist()))


def test_walls_and_both_ends_of_a_barrier_are_blocked():
    free = parse_barrier_map({**ENTRY, 'horizontal_barriers': [], 'vertical_barriers': []})
    walls = blocked(free)
    assert walls == {(x, y) for x in range(11) for y in range(9) if x in (0, 10) or y in (0, 8)}
    barriers = blocked(parse_barrier_map(ENTRY)) - walls
    assert barriers == {(x, 4) for x in range(2, 7)} | {(8, y) for y in range(1, 6)}


def test_a_barrier_of_length_zero_blocks_one_cell():
    entry = {**ENTRY, 'horizontal_barriers': [[4, 5, 5]], 'vertical_barriers': []}
    empty = {**ENTRY, 'horizontal_barriers': [], 'vertical_barriers': []}
    assert blocked(parse_barrier_map(entry)) - blocked(parse_barrier_map(empty)) == {(5, 4)}


def test_barriers_may_run_into_the_open_end_of_the_range_as_in_the_published_data():
    entry = {**ENTRY, 'horizontal_barriers': [[9, 3, 3], [4, 9, 11]], 'vertical_barriers': []}
    assert (9, 4) in blocked(parse_barrier_map(entry))


def test_lattice_points_lie_at_cell_centres():
    entry = {**ENTRY, 'range_x': [-3, 8], 'range_y': [2, 11], 'start_goal': []}
    entry |= {'horizontal_barriers': [], 'vertical_barriers': []}
    barrier_map = parse_barrier_map(entry)
    grid = barrier_map.to_grid(resolution=0.5)
    assert grid.origin == (-1.75, 0.75, 0.0)
    cell = barrier_map.to_cell((4, 6))
    assert barrier_map.to_cell(barrier_map.offset) == (0, 0)
    np.testing.assert_allclose(grid.grid_to_world([cell]), [[2.0, 3.0]])


def test_scaling_multiplies_every_coordinate():
    scaled = parse_barrier_map(ENTRY).scale(3)
    assert (scaled.range_x, scaled.range_y) == ((0, 33), (0, 27))
    assert scaled.horizontal_barriers == (Barrier(12, 6, 18),)
    assert scaled.samples == (Sample((3, 3), (27, 21), ''),)
    with pytest.raises(BarrierMapError, match='scale'):
        scaled.scale(0)
    with pytest.raises(BarrierMapError, match='scale: 100000 gives map'):
        scaled.scale(100000)


def test_open_ended_drops_the_last_cell_of_every_barrier():
    entry = {**ENTRY, 'horizontal_barriers': [[4, 2, 6], [6, 5, 5]]}
    shorter = parse_barrier_map(entry).open_ended()
    assert shorter.horizontal_barriers == (Barrier(4, 2, 5),)
    assert shorter.vertical_barriers == (Barrier(8, 1, 4),)


def test_a_saved_dataset_loads_again(tmp_path):
    maps = [parse_barrier_map(ENTRY), parse_barrier_map({**ENTRY, 'id': 4})]
    save_maps(maps, tmp_path / 'out.json')
    assert load_barrier_maps(tmp_path / 'out.json') == maps


def test_an_unknown_id_lists_the_known_ones():
    with pytest.raises(BarrierMapError, match=r'map id 7 .* holds 3'):
        find_barrier_map([parse_barrier_map(ENTRY)], 7)


@pytest.mark.parametrize(
    ('change', 'words'),
    [
        ({'range_x': [0, 2]}, ['range_x', 'no room']),
        ({'range_x': [0, 'a']}, ['range_x', 'whole number']),
        ({'range_y': None}, ['range_y', '2 whole numbers']),
        ({'range_x': [0, 10**9], 'range_y': [0, 10**9]}, ['range_x', 'cells']),
        ({'horizontal_barriers': [[4, 2]]}, ['horizontal_barriers[0]', '3 whole numbers']),
        ({'horizontal_barriers': [[40, 2, 6]]}, ['horizontal_barriers[0]', '40', 'range 0 to 9']),
        ({'vertical_barriers': [[8, 5, 1]]}, ['vertical_barriers[0]', 'swap']),
        ({'vertical_barriers': 7}, ['vertical_barriers', 'list']),
        ({'start_goal': [[[1, 1]]]}, ['start_goal[0]', 'start, goal']),
        ({'start_goal': [[[1, 1], [11, 7], '']]}, ['start_goal[0]', 'goal x', '11']),
        ({'start_goal': [[[1, 1.5], [9, 7], '']]}, ['start_goal[0]', 'start', '1.5']),
        ({'start_goal': [[[1, 1], [9, 7], 5]]}, ['start_goal[0]', 'query']),
        ({'id': True}, ['id', 'whole number']),
        ({'id': float('nan')}, ['id', 'whole number']),
    ],
)
def test_a_broken_map_names_file_map_and_field(tmp_path, change, words):
    path = write(tmp_path, [ENTRY | {'id': 1}, {**ENTRY, **change}])
    with pytest.raises(BarrierMapError) as error:
        load_barrier_maps(path)
    for word in [str(path), 'map at index 1', *words]:
        assert word in str(error.value)


@pytest.mark.parametrize(
    ('text', 'word'),
    [('{', 'not JSON'), ('[]', 'list'), ('{"id": 1}', 'list'), ('[5]', 'object')],
)
def test_a_file_that_is_not_a_dataset_is_refused(tmp_path, text, word):
    path = write(tmp_path, text)
    with pytest.raises(BarrierMapError, match=word) as error:
        load_barrier_maps(path)
    assert str(path) in str(error.value)


def test_an_id_used_twice_is_refused(tmp_path):
    with pytest.raises(BarrierMapError, match='used twice'):
        load_barrier_maps(write(tmp_path, [ENTRY, ENTRY]))


def test_a_missing_field_and_a_missing_file_are_named(tmp_path):
    entry = {key: value for key, value in ENTRY.items() if key != 'range_x'}
    with pytest.raises(BarrierMapError, match='range_x: is missing'):
        load_barrier_maps(write(tmp_path, [entry]))
    with pytest.raises(BarrierMapError, match=r'nowhere\.json'):
        load_barrier_maps(tmp_path / 'nowhere.json')


json_values = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=5),
    lambda children: st.lists(children, max_size=4),
    max_leaves=12,
)


@given(st.dictionaries(st.sampled_from(sorted(ENTRY)), json_values))
def test_any_json_gives_a_map_or_a_clear_error(change):
    try:
        barrier_map = parse_barrier_map({**ENTRY, **change})
    except BarrierMapError as error:
        assert str(error).startswith('barrier map')
    else:
        assert isinstance(barrier_map, BarrierMap)
