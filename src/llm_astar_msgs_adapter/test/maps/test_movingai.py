import pytest
from llm_astar_msgs_adapter.maps.grid_map import FREE, OCCUPIED
from llm_astar_msgs_adapter.maps.movingai import MovingAiError, load_map, load_scenarios, map_of

MAP = 'type octile\nheight 2\nwidth 3\nmap\n.@G\nSTW\n'
ROW = '3\tx.map\t3\t2\t0\t0\t2\t0\t2.0\n'


def write(tmp_path, name, text):
    path = tmp_path / name
    path.write_text(text)
    return path


def test_free_cells_are_dots_g_and_s(tmp_path):
    grid = load_map(write(tmp_path, 'x.map', MAP))
    assert grid.cells.tolist() == [[FREE, OCCUPIED, FREE], [FREE, OCCUPIED, OCCUPIED]]
    assert grid.width == 3


@pytest.mark.parametrize(
    ('text', 'field'),
    [
        ('', 'type: is missing'),
        ('type octile\nheight two\nwidth 3\nmap\n', "height: 'two'"),
        ('type octile\nheight 2\nwidth 0\nmap\n', 'width: 0'),
        ('type octile\nwidth 3\nheight 2\nmap\n', 'height: is missing'),
        ('type octile\nheight 2\nwidth 3\nmap\n...\n', 'map: 1 rows of 2'),
        ('type octile\nheight 1\nwidth 3\nmap\n....\n', 'map: row 0 has 4 cells'),
    ],
)
def test_a_broken_map_is_named(tmp_path, text, field):
    path = write(tmp_path, 'bad.map', text)
    with pytest.raises(MovingAiError, match='bad.map: ' + field):
        load_map(path)


def test_scenarios_keep_their_order_and_lengths(tmp_path):
    path = write(tmp_path, 'x.map.scen', 'version 1\n' + ROW + ROW.replace('2.0', '2.41421356'))
    rows = load_scenarios(path)
    assert [row.optimal_length for row in rows] == [2.0, 2.41421356]
    assert rows[0].start == (0, 0)
    assert rows[0].goal == (2, 0)
    assert rows[0].bucket == 3


@pytest.mark.parametrize(
    ('text', 'field'),
    [
        ('', 'version: is missing'),
        ('version 1\n1 2 3\n', 'row 0: 3 fields, not 9'),
        (
            'version 1\n' + ROW.replace('\t2\t0\t2.0', '\t9\t0\t2.0'),
            r'row 0: goal: \(9, 0\) is off',
        ),
        ('version 1\n' + ROW + ROW.replace('2.0', 'far'), "row 1: optimal length: 'far"),
        ('version 1\n' + ROW.replace('\t3\t2', '\tw\t2'), "row 0: width: 'w'"),
    ],
)
def test_a_broken_scenario_is_named(tmp_path, text, field):
    path = write(tmp_path, 'bad.scen', text)
    with pytest.raises(MovingAiError, match='bad.scen: ' + field):
        load_scenarios(path)


def test_the_map_is_found_next_to_its_scenarios(tmp_path):
    scenarios = write(tmp_path, 'x.map.scen', 'version 1\n' + ROW)
    with pytest.raises(MovingAiError, match='map: no such file'):
        map_of(scenarios)
    expected = write(tmp_path, 'x.map', MAP)
    assert map_of(scenarios) == expected


def test_a_missing_file_is_named(tmp_path):
    with pytest.raises(MovingAiError, match=r'none\.map'):
        load_map(tmp_path / 'none.map')


def test_a_header_that_asks_for_too_much_memory_is_refused(tmp_path):
    path = tmp_path / 'x.map'
    path.write_text('type octile\nheight 76000\nwidth 76000\nmap\n.\n')
    with pytest.raises(MovingAiError, match='height, width: over 160000000 cells'):
        load_map(path)
