"""What a robot installs: the adapter and the planner, without the laboratory and its libraries."""

import json
import os
import subprocess
import sys
import sysconfig
from pathlib import Path

import pytest

LABORATORY = ('llm_astar_lab', 'llm-astar-lab')
ONLY_FOR_A_DESK = (
    'matplotlib', 'jinja2', 'rosbags', 'mcap', 'duckdb', 'pyarrow', 'starlette', 'uvicorn', 'tqdm',
    'pandas',
)  # fmt: skip
SOURCE = Path(__file__).resolve().parents[1] / 'src'
ROBOT = ('llm_astar_msgs_adapter', 'llm_astar_planner')
IMPORT_ALL = """
import importlib, json, sys
for name in json.loads(sys.argv[1]):
    importlib.import_module(name)
print(json.dumps(sorted({name.partition('.')[0] for name in sys.modules})))
"""


@pytest.fixture(scope='module')
def robot(tmp_path_factory):
    """The environment of processes without the laboratory and its libraries."""
    site = tmp_path_factory.mktemp('site')
    for folder in {sysconfig.get_path('purelib'), sysconfig.get_path('platlib')}:
        for entry in Path(folder).iterdir():
            if not entry.name.lower().startswith((*LABORATORY, *ONLY_FOR_A_DESK)):
                (site / entry.name).symlink_to(entry)
    paths = [*(str(SOURCE / package) for package in ROBOT), str(site)]
    return os.environ | {'PYTHONPATH': os.pathsep.join(paths)}


def python(robot, *words):
    # Without -S Python would find the installed laboratory in its own site-packages.
    return subprocess.run(
        [sys.executable, '-S', *words], env=robot, capture_output=True, text=True
    )


def modules_without_ros():
    for package in ROBOT:
        for path in sorted((SOURCE / package / package).rglob('*.py')):
            parts = path.relative_to(SOURCE / package).with_suffix('').parts
            if not {'nodes', 'messages', '__main__', 'mcp_server'} & set(parts):
                yield '.'.join(part for part in parts if part != '__init__')


def test_every_module_of_a_robot_is_imported_without_the_libraries_of_a_desk(robot):
    done = python(robot, '-c', IMPORT_ALL, json.dumps(list(modules_without_ros())))
    assert done.returncode == 0, done.stderr
    assert not set(json.loads(done.stdout)) & {*ONLY_FOR_A_DESK, 'llm_astar_lab'}


def test_nodes_are_imported_without_the_libraries_of_a_desk():
    pytest.importorskip('rclpy')
    nodes = [
        '.'.join(path.relative_to(SOURCE / 'llm_astar_planner').with_suffix('').parts)
        for path in sorted((SOURCE / 'llm_astar_planner').glob('llm_astar_planner/nodes/**/*.py'))
        if path.stem != '__main__'
    ]
    done = subprocess.run(
        [sys.executable, '-c', IMPORT_ALL, json.dumps(nodes)], capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr
    assert not set(json.loads(done.stdout)) & {*ONLY_FOR_A_DESK, 'llm_astar_lab'}


def test_a_robot_plans(robot):
    done = python(robot, '-m', 'llm_astar_planner.cli', 'plan', '--json')
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout)['code'] == 0


def test_the_help_of_a_robot_lists_what_it_has(robot):
    done = python(robot, '-m', 'llm_astar_planner.cli', '--help')
    assert done.returncode == 0, done.stderr
    assert ' plan ' in done.stdout
    assert ' bench ' not in done.stdout


@pytest.mark.parametrize('command', ['bench', 'play', 'record', 'instruct-bench'])
def test_a_command_of_the_laboratory_says_which_package_has_it(robot, command):
    done = python(robot, '-m', 'llm_astar_planner.cli', command)
    assert done.returncode == 2
    assert done.stderr.startswith(
        f'llm-astar: error: {command} is a command of the package llm_astar_lab, which is not '
        'installed'
    )
    assert done.stderr.count('\n') == 1


def test_a_picture_says_which_package_draws_it(robot, tmp_path):
    words = ('-m', 'llm_astar_planner.cli', 'plan', '--png', str(tmp_path / 'plan.png'))
    done = python(robot, *words)
    assert done.returncode == 2
    assert '--png is drawn by code of the package llm_astar_lab' in done.stderr
    assert done.stdout == ''


def test_benchmark_node_says_which_package_has_it(robot):
    done = python(robot, '-m', 'llm_astar_planner.nodes', 'benchmark_node')
    assert done.returncode == 2
    assert 'benchmark_node is a node of the package llm_astar_lab' in done.stderr
