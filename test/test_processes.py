"""Nodes and commands as processes: how they start without ROS, and that signals end them well."""

import contextlib
import os
import shutil
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import pytest
from graph_tools import wait_for
from llm_astar_lab.pictures import style
from llm_astar_planner.cli.main import main, parse
from llm_astar_planner.cli.run import ended_by_signals, node_arguments
from llm_astar_planner.nodes import MODULES
from llm_astar_planner.nodes.__main__ import start
from llm_astar_planner.nodes.common.spin import ArgumentError, check_arguments
from llm_astar_planner.planning.parameters import NODES, SET_BY_PLANNER
from PIL import Image, ImageColor

NODE = 'from llm_astar_planner.nodes.__main__ import main; run = lambda: main({name!r}, [])'
COMMAND = """
import sys; sys.argv[1:] = {words!r}
from llm_astar_planner.cli.__main__ import main as run
"""
PROGRAMS = {
    **{name: NODE.format(name=name) for name in (*MODULES, 'benchmark_node')},
    'plan': COMMAND.format(words=['plan']),
    'call': COMMAND.format(words=['call', '--start', '1', '1', '--goal', '2', '2']),
}
PATIENCE = 60.0
MAPS = Path(__file__).parents[1] / 'maps' / 'instructions'
# Python itself ends by the signal where Ctrl-C has interrupted the `exec` of a text, as imports;
# a shell shows 130 then too.
INTERRUPTED = {130, -signal.SIGINT}


def python(code, **options):
    return subprocess.Popen(
        [sys.executable, '-c', code], text=True, stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
        **options,
    )  # fmt: skip


def llm_astar(*words):
    return subprocess.Popen(
        [sys.executable, '-m', 'llm_astar_planner.cli', *words],
        text=True, stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
    )  # fmt: skip


@pytest.mark.parametrize('name', MODULES)
def test_the_help_of_a_node_lists_its_parameters_and_starts_nothing(name, capsys):
    assert start(name, ['--help']) == 0
    said = capsys.readouterr().out
    assert said.startswith(f'usage: {name}')
    hidden = SET_BY_PLANNER if name == 'llm_client_node' else ()
    for parameter in NODES[name]:
        assert (f'  {parameter.name} (' in said) is (parameter.name not in hidden)
    assert 'docs/reference.md' in said


def test_a_name_that_no_node_has_is_refused(capsys):
    assert start('planer_node', []) == 2
    assert capsys.readouterr().err.startswith(
        "error: 'planer_node' is no node; there are map_node"
    )


def test_a_help_among_the_ros_arguments_is_not_for_the_node(monkeypatch):
    """As ROS would say itself: `--ros-args --help` is unknown to it."""
    started = []
    monkeypatch.setattr('llm_astar_planner.nodes.map_node.main', started.append)
    with pytest.raises(TypeError):  # the stand-in returns None
        start('map_node', ['--ros-args', '--help'])
    assert started == [['map_node', '--ros-args', '--help']]


def test_an_argument_that_is_not_for_ros_is_refused():
    check_arguments(['map_node', '--ros-args', '-p', 'map_id:=1'])
    with pytest.raises(ArgumentError, match="'--map' is not an option of this node"):
        check_arguments(['map_node', '--map', 'x', '--ros-args', '-p', 'map_id:=1'])


def test_nodes_without_rclpy_say_so_in_one_line():
    without = 'import sys; sys.modules["rclpy"] = None\n'
    nodes = {
        name: python(f'{without}{PROGRAMS[name]}\nsys.exit(run())')
        for name in (*MODULES, 'benchmark_node')
    }
    for name, node in nodes.items():
        said, _ = node.communicate(timeout=PATIENCE)
        assert node.returncode == 1
        assert said.startswith(f'{name}: error: ')
        assert 'rclpy' in said
        assert '`llm-astar doctor`' in said
        assert said.count('\n') == 1


def test_a_node_without_a_home_logs_elsewhere_and_says_so(tmp_path):
    environment = {key: os.environ[key] for key in os.environ if not key.startswith('ROS_LOG')}
    environment |= {'HOME': '/proc/none', 'TMPDIR': str(tmp_path)}
    node = python(f'{PROGRAMS["map_node"]}\nraise SystemExit(run())', env=environment)
    folder = tmp_path / f'ros_{os.getuid()}' / 'log'
    assert node.stdout.readline().startswith(
        f'there is no home to write to, so ROS logs to {folder}'
    )
    assert 'published demo.json' in node.stdout.readline()
    node.send_signal(signal.SIGINT)
    assert 'Traceback' not in node.communicate(timeout=PATIENCE)[0]
    assert node.returncode == 0
    assert any(folder.iterdir())


# A program says how far its start is, by what it has imported: seconds mean something else on
# every machine.
ANNOUNCING = """
import sys
imports = 0
def announce(event, _):
    global imports
    if event == 'import':
        if imports % 25 == 0:
            print('import', imports, flush=True)
        imports += 1
sys.addaudithook(announce)
"""
# Its log is made when a program has joined the graph.
JOINED = 'joined'


def end_at(name, moment, logs):
    """Send SIGINT to a program at a moment of its start, the last of which is JOINED.

    Check how it ends, also where it has ended before that.
    """
    process = python(
        f'{PROGRAMS[name]}\n{ANNOUNCING}\nraise SystemExit(run())',
        env=os.environ | {'ROS_LOG_DIR': str(logs)},
    )
    lines = []
    reader = threading.Thread(target=lambda: lines.extend(process.stdout))
    reader.start()

    def is_there():
        has_joined = any(logs.glob(f'*_{process.pid}_*'))
        return has_joined or f'{moment}\n' in lines or process.poll() is not None

    wait_for(is_there, f'{name}, {moment}')
    process.send_signal(signal.SIGINT)
    code = process.wait(PATIENCE)
    reader.join()
    process.stdout.close()
    said = ''.join(lines)
    assert code in {0, *INTERRUPTED}, f'{name}, {moment}: {said}'
    for word in ('Traceback', 'Exception', 'error'):
        assert word not in said, f'{name}, {moment}: {said}'


def test_ctrl_c_at_any_moment_of_the_start_ends_nodes_and_commands_without_a_traceback(tmp_path):
    for number, name in enumerate(PROGRAMS):
        end_at(name, f'import {100 * number}', tmp_path)
        end_at(name, JOINED, tmp_path)


@pytest.mark.slow
@pytest.mark.parametrize('name', PROGRAMS)
def test_ctrl_c_at_many_moments_of_the_start(name, tmp_path):
    for number in range(60):
        end_at(name, f'import {25 * number}', tmp_path)


def children_of(process):
    """Return the process ids of the nodes that a command has started."""
    path = Path(f'/proc/{process.pid}/task/{process.pid}/children')
    return [int(word) for word in path.read_text().split()]


def is_running(pid):
    with contextlib.suppress(OSError):
        return Path(f'/proc/{pid}/stat').read_text().rpartition(')')[2].split()[0] != 'Z'
    return False


def assert_all_end(pids):
    assert len(pids) == 3
    deadline = time.monotonic() + PATIENCE
    while any(map(is_running, pids)):
        assert time.monotonic() < deadline, 'the nodes run on'
        time.sleep(0.02)


@pytest.mark.parametrize(
    ('number', 'codes'),
    [
        (signal.SIGKILL, {-signal.SIGKILL}),
        (signal.SIGTERM, {128 + signal.SIGTERM}),
    ],
)
def test_a_run_that_is_ended_leaves_no_node_behind(number, codes):
    graph = llm_astar('run', '--namespace', f'ended_{os.getpid()}')
    assert graph.stdout.readline().startswith('running map_node')
    nodes = children_of(graph)
    graph.send_signal(number)
    assert graph.wait(PATIENCE) in codes
    assert_all_end(nodes)
    assert 'Traceback' not in graph.stdout.read()
    graph.stdout.close()


def test_run_keeps_a_graph_that_call_asks_and_draws_until_it_is_interrupted(tmp_path):
    picture, space = tmp_path / 'call.png', f'run_{os.getpid()}'
    graph = llm_astar('run', '--namespace', space, '--log-level', 'error')
    assert graph.stdout.readline().startswith('running map_node, llm_client_node, planner_node')
    nodes = children_of(graph)
    wait = ('--time-limit', str(PATIENCE))
    points = ('--start', '39', '18', '--goal', '7', '19')
    call = llm_astar('call', '--namespace', space, *points, *wait, '--png', str(picture))
    said, _ = call.communicate(timeout=PATIENCE)
    assert call.returncode == 0, said
    assert said.startswith('path found: ')
    assert said.rstrip().endswith(f'picture    {picture}')
    with Image.open(picture) as image:
        colours = {colour for _, colour in image.convert('RGB').getcolors(1 << 20)}
    assert {ImageColor.getrgb(style.PATH), ImageColor.getrgb(style.EXPANDED)} <= colours
    graph.send_signal(signal.SIGINT)
    said, _ = graph.communicate(timeout=PATIENCE)
    assert said == 'llm-astar: interrupted\n'
    assert graph.returncode in INTERRUPTED
    assert_all_end(nodes)


def test_a_hangup_is_left_alone_under_nohup():
    before = signal.signal(signal.SIGHUP, signal.SIG_IGN)
    try:
        with ended_by_signals():
            assert signal.getsignal(signal.SIGHUP) is signal.SIG_IGN
            with pytest.raises(SystemExit, match='143'):
                signal.raise_signal(signal.SIGTERM)
    finally:
        signal.signal(signal.SIGHUP, before)
    assert signal.getsignal(signal.SIGTERM) is signal.SIG_DFL


def test_run_ends_with_its_planner_or_its_map():
    # The node refuses it: it is a map, of another kind.
    graph = llm_astar('run', '--map', 'demo.json', '--map-id', '99', '--log-level', 'error')
    said, _ = graph.communicate(timeout=PATIENCE)
    assert graph.returncode == 1
    assert 'map_node has ended; stopping the others' in said
    assert 'Traceback' not in said


@pytest.mark.parametrize(
    ('words', 'said'),
    [
        (('-p', 'robot_radus:=1.0'), 'did you mean robot_radius?'),
        (('-p', 'robot_radius=1.0'), 'NAME:=VALUE is expected'),
        (('--map', 'nowhere.yaml'), "'nowhere.yaml' is not a file"),
        (('--params-file', 'nowhere.yaml'), "'nowhere.yaml' is not a file"),
    ],
)
def test_run_refuses_what_no_node_understands_before_it_starts_any(words, said, capsys):
    assert main(['run', *words]) == 2
    message = capsys.readouterr().err
    assert said in message
    assert message.startswith('llm-astar: error: ')


def places_of_run(*words):
    """Return the file of places that `run` gives to planner_node, None for none."""
    words = node_arguments(parse(['run', *map(str, words)]))['planner_node']
    given = [word.partition(':=')[2] for word in words if word.startswith('places_file:=')]
    return given[-1] if given else None


def test_run_finds_the_places_beside_the_map_as_plan_does(tmp_path):
    for name in ('house.yaml', 'house.places.geojson', 'office.places.geojson'):
        shutil.copy(MAPS / name, tmp_path)
    house, beside = tmp_path / 'house.yaml', tmp_path / 'house.places.geojson'
    other = str(tmp_path / 'office.places.geojson')
    assert places_of_run('--map', house) == str(beside)
    assert places_of_run('--map', house, '--places', other) == other
    assert places_of_run('--map', house, '-p', f'places_file:={other}') == other
    parameters = tmp_path / 'robot.yaml'
    parameters.write_text(f'planner_node: {{ros__parameters: {{places_file: {other}}}}}')
    assert places_of_run('--map', house, '--params-file', parameters) is None
    assert places_of_run('--no-map') is None
    assert places_of_run('--no-map', '--places', other) == other
    beside.unlink()
    assert places_of_run('--map', house) is None
    assert main(['run', '--places', 'nowhere.geojson']) == 2


DESTRUCTOR = """
import argparse, os, signal, time
from llm_astar_planner.cli.main import run_interruptibly

class Interrupted:
    def __del__(self):
        os.kill(os.getpid(), signal.SIGINT)
        sum(range(1000))

def run(_):
    Interrupted()
    time.sleep(60.0)
    return 0

signal.signal(signal.SIGINT, signal.SIG_DFL)
try:
    run_interruptibly(argparse.Namespace(run=run))
except KeyboardInterrupt:
    print('interrupted')
"""


def test_ctrl_c_within_a_destructor_is_not_lost():
    done = subprocess.run([sys.executable, '-c', DESTRUCTOR], capture_output=True, text=True)
    assert (done.stdout, done.stderr) == ('interrupted\n', '')
