"""What is installed, and that the installed files are the checkout's."""

import json
import os
import subprocess
import sys
import venv
from pathlib import Path
from xml.etree import ElementTree

import pytest
from llm_astar_planner.resources import find_file

ROOT = Path(__file__).resolve().parents[1]
PACKAGES = ('llm_astar_msgs_adapter', 'llm_astar_planner', 'llm_astar_lab')
PREFIX = Path(sys.prefix)
# A shell without ROS.
WHEELS = ('HAS_ROS=', 'ROS_DISTRO=jazzy')
needs_install = pytest.mark.skipif(
    not (PREFIX / 'share' / 'llm_astar_planner').is_dir(), reason='not installed with make install'
)


@needs_install
@pytest.mark.parametrize('folder', ['maps', 'config'])
def test_maps_and_parameter_files_are_installed_as_they_are(folder):
    installed = PREFIX / 'share' / 'llm_astar_planner' / folder
    assert contents(installed) == contents(ROOT / folder)


def contents(folder):
    files = (path for path in folder.rglob('*') if path.is_file())
    return {path.relative_to(folder).as_posix(): path.read_bytes() for path in files}


@needs_install
@pytest.mark.parametrize('package', PACKAGES)
def test_the_ament_index_knows_the_packages(package):
    index = PREFIX / 'share' / 'ament_index' / 'resource_index' / 'packages' / package
    assert index.is_file()
    assert (PREFIX / 'share' / package / 'package.xml').is_file()


@needs_install
def test_ros2_run_would_find_the_nodes():
    folder = PREFIX / 'lib' / 'llm_astar_planner'
    names = {path.name for path in folder.iterdir() if path.stat().st_mode & 0o111}
    assert names >= {'map_node', 'llm_client_node', 'planner_node', 'benchmark_node'}


@needs_install
def test_the_command_is_installed():
    done = subprocess.run(
        [PREFIX / 'bin' / 'llm-astar', 'plan', '--json'], capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout)['code'] == 0


def test_a_colcon_workspace_has_the_command_where_a_shell_looks(tmp_path):
    subprocess.run(
        [sys.executable, 'setup.py', '--quiet', 'install_data', '--install-dir', tmp_path],
        cwd=ROOT / 'src' / 'llm_astar_planner',
        check=True,
        capture_output=True,
    )
    command = tmp_path / 'bin' / 'llm-astar'
    assert command.stat().st_mode & 0o111
    done = subprocess.run([sys.executable, command, '--version'], capture_output=True, text=True)
    assert done.stdout.startswith('llm-astar '), done.stderr


@pytest.mark.parametrize('package', PACKAGES)
def test_package_xml_is_format_3_and_agrees_with_setup(package):
    folder = ROOT / 'src' / package
    root = ElementTree.parse(folder / 'package.xml').getroot()
    assert root.get('format') == '3'
    assert root.findtext('name') == package
    assert root.findtext('license') == 'Apache-2.0'
    assert root.findtext('export/build_type') == 'ament_python'
    assert f'version = {root.findtext("version")}\n' in (folder / 'setup.cfg').read_text()
    assert (folder / package / 'py.typed').is_file()


@pytest.mark.parametrize('package', PACKAGES)
def test_a_package_says_what_it_is_who_made_it_and_where_to_read_more(package):
    folder = ROOT / 'src' / package
    manifest = ElementTree.parse(folder / 'package.xml').getroot()
    fields = ('--url', '--author', '--classifiers', '--long-description')
    said = subprocess.run(
        [sys.executable, 'setup.py', '--quiet', *fields],
        cwd=folder,
        check=True,
        capture_output=True,
        text=True,
    ).stdout
    url, author, rest = said.split('\n', 2)
    assert url == manifest.findtext('url') != ''
    assert author == manifest.findtext('author') != ''
    readme = (folder / 'README.md').read_text().strip()
    assert rest.strip().endswith(readme)
    classifiers = rest.strip().removesuffix(readme).splitlines()
    assert 'License :: OSI Approved :: Apache Software License' in classifiers


@pytest.mark.parametrize('package', PACKAGES)
def test_colcon_can_read_what_setup_says(package):
    # It evaluates the texts of values, which a specifier of versions from setup.cfg has none of.
    code = (
        'import ast, setuptools, distutils.core; '
        "found = distutils.core.run_setup('setup.py', stop_after='config'); "
        'print(ast.literal_eval(repr(found.python_requires)))'
    )
    done = subprocess.run(
        [sys.executable, '-c', code], cwd=ROOT / 'src' / package, capture_output=True, text=True
    )
    assert done.stdout.strip() == '>=3.10', done.stderr


def test_a_file_that_is_not_there_lists_those_that_are():
    with pytest.raises(FileNotFoundError, match=r'demo\.json'):
        find_file('nowhere.json', 'maps')


def make_answers(*words):
    """What make says in a shell without a sourced ROS."""
    # Nor one of the make that runs the tests, whose arguments its children inherit.
    given = ('ROS_DISTRO', 'MAKEFLAGS', 'MAKEOVERRIDES')
    environment = {key: os.environ[key] for key in os.environ if key not in given}
    rule = 'world: ; @echo $(WORLD) $(ROS_REQUIREMENTS)'
    ask = ['make', '--silent', '--eval', rule, *words]
    return subprocess.run(ask, cwd=ROOT, env=environment, capture_output=True, text=True)


@pytest.mark.parametrize(
    ('words', 'world'),
    [
        ((), 'wheels-jazzy'),
        (('ROS_DISTRO=kilted',), 'wheels-kilted'),
        (('ROS_DISTRO=kilted', 'HAS_ROS=yes'), 'sourced-kilted'),
    ],
)
def test_each_distribution_has_an_environment_of_its_own(words, world):
    done = make_answers('world', 'HAS_ROS=', 'VENV=nowhere', *words)
    distribution = world.partition('-')[2]
    assert done.stdout.split()[0] == world
    if world.startswith('wheels'):
        assert f'ros-{distribution}-rclpy[fastrtps] ros-{distribution}-common' in done.stdout


@pytest.mark.parametrize(
    ('words', 'code', 'said'),
    [
        (('ROS_DISTRO=jazzy',), 0, ''),
        (('ROS_DISTRO=kilted',), 0, ''),
        (('ROS_DISTRO=lyrical', 'HAS_ROS=yes'), 0, 'warning: ROS 2 lyrical is untested'),
        (('ROS_DISTRO=lyrical',), 2, 'this needs ROS 2 jazzy or kilted, not lyrical'),
        (('ROS_DISTRO=humble', 'HAS_ROS=yes'), 2, 'this needs ROS 2 jazzy or kilted, not humble'),
    ],
)
def test_distributions_that_are_not_supported_are_named(words, code, said):
    done = make_answers('check-python', f'PYTHON={sys.executable}', 'HAS_ROS=', *words)
    assert done.returncode == code
    assert said in done.stderr
    assert bool(done.stderr) == bool(said)


def test_make_keeps_the_distribution_that_its_environment_has(tmp_path):
    (tmp_path / '.dependencies-wheels-kilted').touch()
    done = make_answers('world', 'HAS_ROS=', f'VENV={tmp_path}')
    assert done.stdout.startswith('wheels-kilted ')
    done = make_answers('world', 'HAS_ROS=', f'VENV={tmp_path}', 'ROS_DISTRO=jazzy')
    assert done.stdout.startswith('wheels-jazzy ')


@pytest.mark.parametrize('target', ['install', 'bench', 'clean'])
def test_make_never_removes_an_environment_that_it_did_not_make(target, tmp_path):
    theirs = tmp_path / 'pyvenv.cfg'
    theirs.touch()
    done = make_answers(target, f'VENV={tmp_path}')
    assert done.returncode == 2
    assert 'is not an environment that this Makefile made' in done.stderr
    assert theirs.exists()


@pytest.fixture
def environment(tmp_path):
    """An environment at tmp_path/old as make leaves it, with one command."""
    folder = tmp_path / 'old'
    venv.create(folder, with_pip=False, symlinks=True)
    for name in ('pip', 'hello'):
        command = folder / 'bin' / name
        command.write_text(f'#!{folder}/bin/python\nimport sys; print(sys.prefix)\n')
        command.chmod(0o755)
    for name in ('.made-by-make', '.dependencies-wheels-jazzy', '.installed'):
        (folder / name).touch()
    return folder


def test_make_install_repairs_an_environment_that_was_moved_with_its_clone(environment, tmp_path):
    moved = environment.rename(tmp_path / 'new')
    with pytest.raises(FileNotFoundError):
        subprocess.run([moved / 'bin' / 'hello'], check=True)
    words = ('install', f'VENV={moved}', f'PYTHON={sys.executable}', *WHEELS)
    done = make_answers(*words)
    assert done.returncode == 0, done.stderr
    assert f'the environment was at {environment}: repairing the paths' in done.stdout
    said = subprocess.run([moved / 'bin' / 'hello'], capture_output=True, text=True, check=True)
    assert Path(said.stdout.strip()) == moved
    assert str(environment) not in (moved / 'bin' / 'activate').read_text()
    assert 'repairing' not in make_answers(*words).stdout


def test_an_environment_that_is_reached_by_a_link_is_not_taken_for_moved(environment, tmp_path):
    link = tmp_path / 'link'
    link.symlink_to(environment)
    done = make_answers('install', f'VENV={link}', f'PYTHON={sys.executable}', *WHEELS)
    assert done.returncode == 0, done.stderr
    assert 'repairing' not in done.stdout


@pytest.mark.parametrize('target', ['install', 'dist', 'clean'])
def test_make_never_removes_the_environment_of_another_checkout(target, environment):
    (environment / '.made-by-make').write_text('/home/somebody/llm-astar\n')
    done = make_answers(target, f'VENV={environment}', f'PYTHON={sys.executable}', *WHEELS)
    assert done.returncode == 2
    assert 'is the environment of the checkout /home/somebody/llm-astar' in done.stderr
    assert (environment / 'bin' / 'hello').exists()


@needs_install
def test_make_does_not_take_an_activated_environment_for_a_sourced_ros():
    ask = ['make', '--eval', 'world: ; @echo the world is $(WORLD)', 'world']

    def answer(path):
        environment = {key: os.environ[key] for key in os.environ if key != 'PYTHONPATH'}
        done = subprocess.run(
            ask, cwd=ROOT, env=environment | {'PATH': path}, capture_output=True, text=True
        )
        return done.stdout

    inactive = os.pathsep.join(
        folder for folder in os.environ['PATH'].split(os.pathsep) if folder != f'{PREFIX}/bin'
    )
    activated = f'{PREFIX}/bin{os.pathsep}{inactive}'
    assert 'the world is ' in answer(inactive)
    assert answer(activated) == answer(inactive)
