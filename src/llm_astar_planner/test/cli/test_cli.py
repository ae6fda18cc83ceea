"""The command line as a user types it, without ROS."""

import json
import re
import subprocess
import sys

import numpy as np
import pytest
from llm_astar_lab.commands import COMMANDS as LAB_COMMANDS
from llm_astar_lab.pictures.style import OBSTACLE
from llm_astar_planner.cli.main import COMMANDS, main
from llm_astar_planner.planning.parameters import PLANNER, SOURCE
from llm_astar_planner.resources import find_file
from PIL import Image

from llm_astar_planner import plugins

HOUSE = ('--map', 'instructions/house.yaml', '--start', '2', '2', '--goal', '9', '6')
KEYS = {
    'code',
    'code_name',
    'path',
    'waypoints',
    'guided_by',
    'operation',
    'storage',
    'length',
    'seconds_source',
    'seconds_search',
}


def run(capsys, *arguments):
    code = main(list(arguments))
    out, err = capsys.readouterr()
    return code, out, err


def run_json(capsys, *arguments):
    code, out, err = run(capsys, *arguments, '--json')
    assert err == ''
    return code, json.loads(out)


@pytest.fixture
def shifted(tmp_path):
    """A map whose coordinates do not start at zero."""
    path = tmp_path / 'shifted.json'
    barriers = {'horizontal_barriers': [[110, -40, -15]], 'vertical_barriers': []}
    entry = {'id': 0, 'range_x': [-50, 1], 'range_y': [100, 131], 'start_goal': [], **barriers}
    path.write_text(json.dumps([entry]))
    return str(path)


def test_plan_prints_one_json_object(capsys):
    code, plan = run_json(
        capsys, 'plan', '--pair', '0', '--reply', 'Generated Path: [[31, 10], [27, 9], [60, 2]]'
    )
    assert code == 0
    assert set(plan) >= KEYS
    assert (plan['code'], plan['code_name']) == (0, 'NONE')
    assert plan['path'][0] == [39, 18]
    assert plan['path'][-1] == [7, 19]
    assert plan['guided_by'] == 'reply'
    assert plan['waypoints'][0] == {'x': 31.0, 'y': 10.0, 'verdict': 'accepted'}
    assert plan['waypoints'][2]['verdict'] == 'out_of_bounds'


def test_replayed_waypoints_guide_better_than_none_on_the_demo(capsys):
    transcript = str(find_file('demo_transcript.jsonl', 'maps'))
    replay = ['--source', 'replay', '--transcript', transcript]
    figures = {
        name: run_json(capsys, 'plan', *arguments)[1]['operation']
        for name, arguments in {
            'astar': ['--method', 'astar'],
            'none': ['--method', 'llm_astar', '--source', 'none'],
            'replay': ['--method', 'llm_astar', *replay],
            'guided': replay,
        }.items()
    }
    assert figures == {'astar': 721, 'none': 439, 'replay': 49, 'guided': 38}


def test_coordinates_are_those_of_the_map(capsys, shifted):
    code, plan = run_json(
        capsys, 'plan', '--map', shifted, '--start', '-30', '105', '--goal', '-30', '120',
        '--reply', '[[-14, 110], [-14, 111]]',
    )  # fmt: skip
    assert code == 0
    assert plan['path'][0] == [-30, 105]
    assert [point['verdict'] for point in plan['waypoints']] == ['accepted', 'accepted']
    assert plan['waypoints'][0]['x'] == -14


def test_guided_proves_its_bound_unless_the_first_path_is_requested(capsys):
    bounded = run_json(capsys, 'plan', '--map-id', '1')[1]
    first = run_json(capsys, 'plan', '--map-id', '1', '--max-suboptimality', '0')[1]
    assert 1.0 <= bounded['ratio'] <= 1.1
    assert first['first_operation'] == first['operation'] <= bounded['operation']


def test_a_closed_pipe_is_not_an_error():
    command = f'{sys.executable} -m llm_astar_planner.cli.main plan --any-angle | head -c 1'
    done = subprocess.run(command, shell=True, capture_output=True, text=True)  # noqa: S602
    assert done.stderr == ''
    assert done.stdout == 'p'


def test_no_plan_is_exit_code_1_and_still_json(capsys):
    code, plan = run_json(capsys, 'plan', '--start', '0', '0', '--goal', '5', '5')
    assert code == 1
    assert (plan['code'], plan['code_name']) == (205, 'START_OCCUPIED')
    assert plan['path'] == []
    assert plan['length'] is None


ROOM = """\
image: room.pgm
resolution: 0.05
origin: [-1.0, -2.0, 0]
negate: 0
occupied_thresh: 0.65
free_thresh: 0.25
"""


@pytest.fixture
def room(tmp_path):
    """A map_server map: 60 x 40 cells with a wall that leaves a door of 11 at the top."""
    pixels = np.full((40, 60), 254, dtype=np.uint8)
    pixels[11:, 30] = 0
    Image.fromarray(pixels).save(tmp_path / 'room.pgm')
    (tmp_path / 'room.yaml').write_text(ROOM)
    return str(tmp_path / 'room.yaml')


def test_a_robots_body_is_kept_off_the_walls_of_a_map_server_map(capsys, room):
    where = ['plan', '--map', room, '--cells', '--start', '5', '20', '--goal', '55', '20']
    point = run_json(capsys, *where)[1]
    body = run_json(capsys, *where, '--robot-radius', '0.2')[1]
    wary = run_json(capsys, *where, '--robot-radius', '0.2', '--inflation-radius', '0.5')[1]
    assert point['clearance'] < 0.2 < body['clearance']
    assert body['length'] <= wary['length']
    assert wary['cost'] > wary['length']
    code, stuck = run_json(capsys, *where, '--robot-radius', '0.6')
    assert (code, stuck['code_name']) == (1, 'NO_VALID_PATH')


def test_shifts_by_tolerances_and_via_cells_are_reported(capsys, room):
    where = ['plan', '--map', room, '--cells', '--start', '30', '35']
    code, refused = run_json(capsys, *where, '--goal', '66', '20', '--tolerance', '0.5')
    assert (code, refused['code_name']) == (1, 'GOAL_OUTSIDE_MAP')
    where += ['--goal', '32', '20', '--robot-radius', '0.2', '--tolerance', '0.5']
    where += ['--via', '10', '9', '--via', '50', '33']
    code, plan = run_json(capsys, *where)
    assert code == 0
    assert plan['goal'] == plan['path'][-1] == [35, 20]
    assert plan['goal_shift'] == pytest.approx(0.15)
    assert plan['path'].index([10, 9]) < plan['path'].index([50, 33])
    assert len(plan['warnings']) == 1
    text = run(capsys, *where)[1]
    assert 'warning    the goal cell (32, 20) at (0.625, -0.975) m is not free' in text
    assert 'clearance  4.47 cells to the nearest obstacle' in text
    escape = ['--start', '28', '20', '--goal', '10', '20', '--start-tolerance', '0.3']
    words = ('plan', '--map', room, '--cells', '--robot-radius', '0.2')
    plan = run_json(capsys, *words, *escape)[1]
    assert plan['start'] == plan['path'][0] == [25, 20]
    assert plan['start_shift'] == pytest.approx(0.15)


def test_points_are_metres_on_a_robots_map_and_cells_elsewhere(capsys, room):
    metres = ('--start', '-0.7', '-1', '--goal', '1.77', '-0.98')
    where = ['plan', '--map', room, '--source', 'none']
    plan = run_json(capsys, *where, *metres, '--via', '0.5', '-0.3')[1]
    assert (plan['start'], plan['goal']) == ([6, 20], [55, 20])
    assert [30, 34] in plan['path']
    cells = run_json(
        capsys, *where, '--cells', '--start', '6', '20', '--goal', '55', '20', '--via', '30', '34'
    )[1]
    assert cells['path'] == plan['path']
    lines = run(capsys, *where, *metres)[1].splitlines()
    assert lines[0].startswith('path found: ')
    assert ' m (' in lines[0]
    assert lines[2:4] == [
        'start      (-0.675, -0.975) m, cell (6, 20)',
        'goal       (1.775, -0.975) m, cell (55, 20)',
    ]
    here = ('plan', '--source', 'none', '--metres', '--start', '38.6', '18.4', '--goal', '7', '19')
    assert run_json(capsys, *here)[1]['start'] == [39, 18]


def test_a_point_in_the_wrong_unit_is_told_which_is_the_right_one(capsys, room):
    code, _, err = run(capsys, 'plan', '--start', '5.5', '5', '--goal', '20', '21')
    assert code == 2
    assert err.startswith('llm-astar: error: --start 5.5 5: coordinates are cells on this map')
    assert '--metres' in err
    where = ('plan', '--map', room, '--start', '5', '20', '--goal', '55', '20')
    code, out, err = run(capsys, *where)
    assert code == 1
    assert 'no path: the start cell (120, 440) at (5.025, 20.025) m is outside' in out
    assert out.splitlines()[0].endswith(' [START_OUTSIDE_MAP 203]')
    assert (
        err == 'llm-astar: hint: coordinates are metres on this map; add --cells to give cells\n'
    )
    assert run(capsys, *where[:3], '--start', '5.5', '2', '--goal', '1', '1')[2] == ''


def test_waypoints_that_are_required_and_do_not_come_are_exit_code_3(capsys):
    words = ('plan', '--require-waypoints')
    nobody = ('--source', 'endpoint', '--base-url', 'http://127.0.0.1:9/v1', '--max-retries', '0')
    code, out, err = run(capsys, *words, *nobody, '--model', 'x')
    assert code == 3
    first = out.splitlines()[0]
    assert first.startswith('path found: ')
    assert '; no waypoints from endpoint: 127.0.0.1 is unreachable' in first
    assert first.endswith('[UNREACHABLE]')
    assert err == 'llm-astar: --require-waypoints: no waypoint came that can be used\n'
    assert run(capsys, *words, '--reply', '[[0, 0], [60, 5]]')[0] == 3
    assert run(capsys, *words, '--reply', '[[31, 10], [27, 9]]')[0] == 0
    assert run(capsys, *words, '--start', '0', '0', '--goal', '5', '5')[0] == 1


@pytest.mark.parametrize(
    ('arguments', 'words'),
    [
        (['--source', 'none'], 'none asked'),
        (['--no-use-waypoints'], 'none asked'),
        (['--method', 'astar'], 'none asked: astar uses no waypoints'),
        (['--via', '30', '8'], 'none asked: the via points take their place'),
        (['--reply', '[]'], 'none: reply suggests none: the model answered with an empty list'),
        (['--reply', 'x'], 'none from reply: no list of points in the reply [MALFORMED]'),
        (['--reply', '[[31, 10], [0, 0]]'], '1 accepted, 1 occupied, from reply'),
        (
            [*HOUSE, '--reply', '[[50, 27], [71, 50]]'],
            '2 accepted, from reply; the path was found without them',
        ),
    ],
)
def test_one_line_says_what_became_of_the_waypoints(capsys, arguments, words):
    lines = run(capsys, 'plan', *arguments)[1].splitlines()
    assert [line for line in lines if line.startswith('waypoints ')] == [f'waypoints  {words}']


def test_a_person_reads_the_plan(capsys):
    code, out, _ = run(capsys, 'plan', '--reply', 'no idea')
    assert code == 0
    first, *lines = out.splitlines()
    assert first.startswith('path found: 43.38 cells, 38 expansions, proven within 1.0000 of the')
    assert first.endswith('; no waypoints from reply: no list of points in the reply [MALFORMED]')
    assert lines[:3] == [
        'start      cell (39, 18)',
        'goal       cell (7, 19)',
        'waypoints  none from reply: no list of points in the reply [MALFORMED]',
    ]
    assert 'NONE' not in out


def test_the_picture_is_drawn_where_asked(capsys, tmp_path):
    picture = tmp_path / 'new' / 'plan.png'
    code, out, _ = run(capsys, 'plan', '--reply', '[[31, 10], [27, 10]]', '--png', str(picture))
    assert code == 0
    assert str(picture) in out
    with Image.open(picture) as image:
        assert image.width > 600
        assert len(image.convert('RGB').getcolors(1 << 20)) > 10


def test_the_picture_has_the_obstacles_of_the_rules(capsys, tmp_path):
    grey = np.full((20, 20), 255, dtype=np.uint8)
    grey[8:12, 8:12] = 128  # occupancy 50
    Image.fromarray(grey).save(tmp_path / 'x.pgm')
    (tmp_path / 'x.yaml').write_text(
        'image: x.pgm\nresolution: 0.05\norigin: [0, 0, 0]\nnegate: 0\nmode: scale\n'
        'occupied_thresh: 0.9\nfree_thresh: 0.1\n'
    )
    ends = ('--cells', '--start', '1', '1', '--goal', '18', '1')
    words = ('--map', str(tmp_path / 'x.yaml'), *ends)
    obstacle = tuple(bytes.fromhex(OBSTACLE[1:]))
    shares = []
    for threshold in ('40', '90'):
        picture = tmp_path / f'{threshold}.png'
        rule = ('--occupied-threshold', threshold)
        code, *_ = run(capsys, 'plan', *words, *rule, '--png', str(picture))
        assert code == 0
        with Image.open(picture) as image:
            pixels = np.array(image.convert('RGB'))
        shares.append(np.mean(np.all(pixels == obstacle, axis=-1)))
    # The obstacle covers a twenty-fifth of the map, which fills more than half of the picture.
    assert shares[0] > 0.02
    assert shares[1] < 0.002


@pytest.mark.parametrize(
    ('arguments', 'words'),
    [
        (['--method', 'theta'], ["--method: 'theta'", 'weighted_astar']),
        (['--method', 'gudied'], ['llm_astar; did you mean guided?']),
        (['--source', 'embeded'], ['did you mean embedded?']),
        (['--heuristic', 'l7'], ["--heuristic: 'l7'", 'octile']),
        (['--source', 'oracle9'], ['source', 'oracle9', 'replay']),
        (['--source', 'replay'], ['transcript']),
        (['--source', 'replay', '--transcript', 'nowhere.jsonl'], ['nowhere.jsonl']),
        (['--map', 'nowhere.json'], ['nowhere.json', 'demo.json']),
        (['--map-id', '99'], ['99', 'holds 0, 1, 2']),
        (['--pair', '99'], ['--pair 99']),
        (['--start', '1', '1'], ['--goal']),
        (['--weight', '0.5'], ['--weight: 0.5']),
        (['--max-planning-time', '-1'], ['--max-planning-time', '0.01']),
        (['--record', 'a.jsonl', '--source', 'embedded'], ['--record', '--source endpoint']),
        (['--max-suboptimality', '0.9'], ['--max-suboptimality: 0.9', '1 to 1000, or 0']),
        (['--tolerance', '-1'], ['--tolerance: -1']),
        (['--png', 'plan.xyz'], ['xyz']),
        (['--png', '.'], ['.: Is a directory']),
        (['--instruction', 'x' * 501], ['instruction', '501', '500']),
        (['--robot-radius', '-1'], ['--robot-radius', '-1.0', '0 to 10']),
    ],
)
def test_bad_usage_is_one_line_and_exit_code_2(capsys, arguments, words):
    code, _, err = run(capsys, 'plan', *arguments)
    assert code == 2
    assert err.startswith('llm-astar: error: ')
    assert err.count('\n') == 1
    for word in words:
        assert word in err


def test_plan_keeps_to_the_zones_of_a_file(capsys, tmp_path):
    ring = [[3, -1], [8, -1], [8, 30], [3, 30], [3, -1]]
    rule = {'kind': 'one_way', 'heading': 180}
    feature = {'type': 'Feature', 'id': 'west', 'properties': rule}
    feature['geometry'] = {'type': 'Polygon', 'coordinates': [ring]}
    zones = tmp_path / 'rules.geojson'
    zones.write_text(json.dumps({'type': 'FeatureCollection', 'features': [feature]}))
    code, out, _ = run(capsys, 'plan', *HOUSE, '--zones', str(zones))
    assert code == 1
    assert 'the one-way west closes the way' in out
    rule['heading'] = 0
    zones.write_text(json.dumps({'type': 'FeatureCollection', 'features': [feature]}))
    assert run(capsys, 'plan', *HOUSE, '--zones', str(zones))[0] == 0
    rule['kind'] = 'oneway'
    zones.write_text(json.dumps({'type': 'FeatureCollection', 'features': [feature]}))
    code, _, err = run(capsys, 'plan', *HOUSE, '--zones', str(zones))
    assert code == 2
    assert "rules.geojson: zones: feature 0: zone west: kind: 'oneway' is not one of" in err


def test_a_broken_map_names_file_map_and_field(capsys, tmp_path):
    path = tmp_path / 'broken.json'
    path.write_text('[{"id": 5, "range_x": [0, 51], "range_y": "wide"}]')
    code, _, err = run(capsys, 'plan', '--map', str(path))
    assert code == 2
    for word in (str(path), 'id 5', 'range_y', 'wide'):
        assert word in err


def test_doctor_finds_what_is_installed(capsys):
    code, report = run_json(capsys, 'doctor')
    findings = {finding['name']: finding for finding in report['findings']}
    assert code == (0 if report['ok'] else 1)
    for name in ('python', 'numpy', 'numba', 'searches', 'maps/', 'config/'):
        assert findings[name]['found'], findings[name]
    assert 'for ros2' in findings['ros2cli']['detail'] or findings['ros2cli']['found']


def test_doctor_says_how_to_install_what_is_missing(capsys, monkeypatch):
    monkeypatch.setitem(sys.modules, 'rclpy.node', None)
    code, out, _ = run(capsys, 'doctor')
    assert code == 1
    line = next(line for line in out.splitlines() if ' rclpy ' in line)
    assert line.startswith('MISSING')
    assert 'make install' in line


@pytest.mark.parametrize('command', [*COMMANDS, *LAB_COMMANDS])
def test_every_command_says_what_it_does(capsys, command):
    with pytest.raises(SystemExit) as end:
        main([command, '--help'])
    assert end.value.code == 0
    text = capsys.readouterr().out
    usage, description, *_ = text.split('\n\n')
    assert usage.count('\n') < 6
    assert 'exit code' in text
    assert usage.startswith(f'usage: llm-astar {command} ')
    assert description.rstrip().endswith('.')


def test_the_commands_of_the_laboratory_are_known_where_it_is_not_installed():
    assert tuple(LAB_COMMANDS) == plugins.LAB_COMMANDS


def without(module, *arguments):
    """Run a command where a module is not installed."""
    program = (
        f'import sys; sys.modules[{module!r}] = None; '
        f'from llm_astar_planner.cli.main import main; sys.exit(main({list(arguments)!r}))'
    )
    return subprocess.run([sys.executable, '-c', program], capture_output=True, text=True)


@pytest.mark.parametrize('module', ['numpy', 'numba', 'httpx'])
def test_doctor_runs_without_what_it_finds_missing(module):
    done = without(module, 'doctor')
    assert done.returncode == 1
    assert f'MISSING  {module} ' in done.stdout, done.stderr


def test_a_command_without_its_libraries_refers_to_the_doctor():
    done = without('numba', 'plan')
    assert done.returncode == 1
    assert done.stderr.count('\n') == 1
    assert 'numba' in done.stderr
    assert 'llm-astar doctor' in done.stderr


def test_plan_needs_no_ros():
    program = (
        'import sys; sys.modules["rclpy"] = sys.modules["nav_msgs"] = None; '
        'from llm_astar_planner.cli.main import main; sys.exit(main(["plan"]))'
    )
    done = subprocess.run([sys.executable, '-c', program], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert done.stdout.startswith('path found: ')


def test_flags_override_a_parameter_file_and_the_nodes_defaults_hold_for_the_rest(
    capsys, tmp_path
):
    file = tmp_path / 'robot.yaml'
    file.write_text(
        'planner_node: {ros__parameters: {method: astar, robot_radius: 1.0}}\n'
        'llm_client_node: {ros__parameters: {source: straight}}'
    )
    arguments = ['plan', '--params-file', str(file)]
    by_file = run_json(capsys, *arguments)[1]
    assert by_file['method'] == 'astar'
    assert by_file['clearance'] > 1.0
    by_flags = run_json(capsys, *arguments, '--method', 'guided', '--robot-radius', '0')[1]
    assert (by_flags['method'], by_flags['clearance']) == ('guided', 1.0)
    assert by_flags['source'] == 'straight'
    # Corners are cut by default on barrier maps, and not by a node.
    cutting = run_json(capsys, *arguments, '--robot-radius', '0', '--corner-cutting')[1]
    kept = run_json(capsys, *arguments, '--robot-radius', '0')[1]
    assert cutting['length'] < kept['length']
    assert cutting['length'] == run_json(capsys, 'plan', '--method', 'astar')[1]['length']


@pytest.mark.parametrize(
    ('arguments', 'words'),
    [
        (
            ['plan', '--robot-raduis', '1'],
            'no option --robot-raduis; did you mean --robot-radius?',
        ),
        (
            ['bench', '--metods=astar'],
            'no option --metods=astar; did you mean --methods?',
        ),
        (['--jsn', 'plan'], 'llm-astar has no option --jsn'),
    ],
)
def test_what_does_not_exist_is_one_line_that_says_what_does(capsys, arguments, words):
    code, _, err = run(capsys, *arguments)
    assert code == 2
    assert err.startswith('llm-astar: error: ')
    assert err.count('\n') == 1
    assert words in err


def test_the_time_limit_and_the_methods_have_one_name_in_all_commands(capsys):
    plan = ('plan', '--time-limit', '20', '--methods', 'astar', '--json')
    code, out, err = run(capsys, *plan)
    assert (code, err) == (0, '')
    assert json.loads(out)['method'] == 'astar'
    for command in ('plan', 'mcp', 'bench', 'evaluate', 'instruct-bench', 'call'):
        with pytest.raises(SystemExit):
            main([command, '--help'])
        assert '--time-limit SECONDS' in capsys.readouterr().out, command
    for command in ('plan', 'play', 'places', 'mcp', 'run', 'bench', 'draw'):
        with pytest.raises(SystemExit):
            main([command, '--help'])
        assert '--map FILE' in capsys.readouterr().out, command


@pytest.mark.parametrize(
    ('command', 'words'),
    [
        (('plan', '--start', 'a', '1', '--goal', '2', '2'), "not a number: 'a'"),
        (('plan', '--png', 'plan.xyz'), "plan.xyz ends in '.xyz'; the ending is one of .png"),
        (('call', '--png', 'plan.xyz'), "plan.xyz ends in '.xyz'"),
        (('places', 'x.geojson', '--png', 'places'), 'places has no ending'),
        (('draw', '--out', 'x.mp4'), "x.mp4 ends in '.mp4'"),
        (('plan', '--start', 'nan', '1', '--goal', '2', '2'), '--start nan 1: numbers'),
        (('plan', '--map', 'instructions/README.md'), 'README.md: not JSON: '),
        (('plan', '--map', 'instructions/README.md'), "--map takes a robot's map as a map_server"),
        (('plna',), "invalid choice: 'plna'"),
        (('plan', '--cells', '--metres'), 'not allowed with'),
    ],
)
def test_a_mistake_is_one_line_before_any_work(capsys, monkeypatch, command, words):
    def no_work(*_):
        raise AssertionError('work was done')

    monkeypatch.setattr('llm_astar_planner.planning.planner.Planner.plan', no_work)
    code, out, err = run(capsys, *command)
    assert (code, out) == (2, '')
    assert err.startswith('llm-astar: error: ')
    assert err.count('\n') == 1
    assert words in err


def test_without_a_command_the_help_is_printed(capsys):
    with pytest.raises(SystemExit) as end:
        main([])
    assert end.value.code == 0
    assert 'commands:' in capsys.readouterr().out


def test_an_unknown_name_in_a_parameter_file_names_the_file_and_the_nearest_name(capsys, tmp_path):
    file = tmp_path / 'robot.yaml'
    file.write_text('planner_node: {ros__parameters: {robot_raduis: 0.2}}')
    code, _, err = run(capsys, 'plan', '--params-file', str(file))
    assert code == 2
    for words in (str(file), 'robot_raduis', 'did you mean robot_radius?'):
        assert words in err


def test_what_a_file_says_controls_no_terminal(capsys, tmp_path):
    (tmp_path / 'map.yaml').write_text(
        'image: "x\\e[2J.pgm"\nresolution: 1.0\norigin: [0, 0, 0]\noccupied_thresh: 0.65\n'
        'free_thresh: 0.2\nnegate: 0\n'
    )
    code, out, err = run(capsys, 'plan', '--map', str(tmp_path / 'map.yaml'), *HOUSE[2:])
    assert (code, out) == (2, '')
    assert 'x?[2J.pgm' in err
    assert '\x1b' not in err


def test_every_parameter_that_decides_a_plan_has_a_flag(capsys):
    with pytest.raises(SystemExit):
        main(['plan', '--help'])
    text = capsys.readouterr().out
    for item in (*PLANNER, *SOURCE):
        assert (f'--{item.name.replace("_", "-")}' in text) != item.node_only, item.name


def test_help_is_printed_without_the_libraries_of_the_commands():
    program = (
        'import sys; from llm_astar_planner.cli.main import main\n'
        'try: main(["--help"])\n'
        'finally: print(sorted({"numpy", "numba", "yaml", "scipy"} & set(sys.modules)))'
    )
    done = subprocess.run([sys.executable, '-c', program], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert done.stdout.splitlines()[-1] == '[]'


def test_a_robot_without_a_radius_is_named_where_its_path_is_close_to_an_obstacle(capsys):
    office = ('plan', '--map', 'instructions/office.yaml', '--start', '2', '2', '--goal', '8', '8')
    said = 'warning    the robot is a point, as robot_radius is 0'
    assert said in run(capsys, *office)[1]
    assert said not in run(capsys, *office, '--robot-radius', '0.3')[1]
    # Cells of a map without metres have no size to compare with.
    assert said not in run(capsys, 'plan')[1]


def test_a_shipped_map_is_found_by_its_short_name_with_its_places_and_metres(capsys):
    ends = '--robot-radius', '0.3', '--from', 'bathroom', '--to', 'kitchen'
    code, text, errors = run(capsys, 'plan', '--map', 'house', *ends)
    assert (code, errors) == (0, '')
    assert re.search(r'start +\(.* m, cell \(.*, bathroom\n', text)
    # Where a file is missing, the names are listed.
    missing = run(capsys, 'plan', '--map', 'depto', *ends)[2]
    assert 'office.yaml' in missing
    assert missing.endswith('did you mean depot?\n')


def test_waypoints_that_the_checks_let_through_are_called_accepted(capsys):
    """They need not lie on the path: the search beside them may have found a shorter one."""
    first = run(capsys, 'plan')[1].splitlines()[0]
    assert first.endswith(', 3 of 3 waypoints accepted')
