"""`make dist`: what pip installs of the wheels plans, draws and measures without ROS."""

import importlib.metadata
import json
import os
import re
import shutil
import subprocess
import sys
import tarfile
import venv
import zipfile
from pathlib import Path

import httpx
import pytest

import llm_astar_planner

ROOT = Path(__file__).resolve().parents[1]
OWN = ('llm_astar_lab', 'llm_astar_msgs_adapter', 'llm_astar_planner', 'llm_astar_ros')
COPIED = ('Makefile', 'LICENSE', 'config', 'maps', 'packaging', 'src')


@pytest.fixture(scope='module')
def dist(tmp_path_factory):
    """The folder of wheels and source archives, built in a copy of the checkout."""
    clone = tmp_path_factory.mktemp('clone')
    leave_out = shutil.ignore_patterns('test', 'build', '*.egg-info', '__pycache__')
    for name in COPIED:
        source, copy = ROOT / name, clone / name
        if source.is_dir():
            shutil.copytree(source, copy, symlinks=True, ignore=leave_out)
        else:
            shutil.copy(source, copy)
    python = clone / '.venv' / 'bin' / 'python'
    python.parent.mkdir(parents=True)
    python.write_text(f'#!/bin/sh\nexec {sys.executable} "$@"\n')
    python.chmod(0o755)
    (clone / '.venv' / '.dependencies-wheels-jazzy').touch()
    words = ['make', 'dist', f'PYTHON={sys.executable}', 'HAS_ROS=', 'ROS_DISTRO=jazzy']
    given = ('MAKEFLAGS', 'MAKEOVERRIDES', 'VENV', 'PYTHONPATH')
    environment = {key: os.environ[key] for key in os.environ if key not in given}
    done = subprocess.run(words, cwd=clone, env=environment, capture_output=True, text=True)
    if "invalid command 'bdist_wheel'" in done.stderr:
        pytest.skip('the environment has no package `wheel`; make install brings it')
    assert done.returncode == 0, done.stdout + done.stderr
    assert 'building the wheel of ./src/llm_astar_planner' in done.stdout
    return clone / 'out' / 'dist'


def test_there_are_a_wheel_and_a_source_archive_of_each(dist):
    names = {path.name for path in dist.iterdir()}
    version = versions()['llm_astar_planner']
    assert {f'{name}-{version}-py3-none-any.whl' for name in OWN} < names
    # Newer setuptools write '_' for '-' in the names of archives, too.
    archives = {name.replace('llm-astar-ros', 'llm_astar_ros') for name in names}
    assert {f'{name}-{version}.tar.gz' for name in OWN} < archives


def versions():
    """Return the version that each package says, by where it says it."""
    found = {
        path.parent.name: re.search(r'^version = "?([\d.]+)', path.read_text(), re.MULTILINE)[1]
        for path in (*ROOT.glob('src/*/setup.cfg'), ROOT / 'packaging' / 'pyproject.toml')
    }
    init = (ROOT / 'src' / 'llm_astar_planner' / 'llm_astar_planner' / '__init__.py').read_text()
    return found | {'__version__': re.search(r"^__version__ = '(.*)'", init, re.MULTILINE)[1]}


def test_every_package_has_the_same_version():
    assert len(set(versions().values())) == 1
    demanded = re.findall(r'==([\d.]+)', (ROOT / 'packaging' / 'pyproject.toml').read_text())
    assert {*demanded} == {*versions().values()}
    assert len(demanded) == 3


def test_each_wheel_has_its_licence_and_no_tests(dist):
    for wheel in dist.glob('*.whl'):
        names = zipfile.ZipFile(wheel).namelist()
        # Newer setuptools put it into a folder `licenses`.
        licences = [name for name in names if re.search(r'\.dist-info/(licenses/)?LICENSE$', name)]
        assert licences, wheel
        assert not [name for name in names if '/test/' in name], wheel


def test_a_source_archive_has_what_its_wheel_is_built_from(dist):
    with tarfile.open(next(dist.glob('llm_astar_planner-*.tar.gz'))) as archive:
        names = {name.partition('/')[2] for name in archive.getnames()}
    assert {'setup.py', 'setup.cfg', 'package.xml', 'LICENSE', 'maps/demo.json'} <= names
    assert 'llm_astar_planner/instructions/grammar/clauses.lark' in names
    # A link that leads out of the archive would be empty elsewhere.
    assert 'config/planner.yaml' in names


def libraries(folder):
    """Link to all that is installed here but ROS and this project; return how many entries."""
    site = Path(importlib.metadata.distribution('numpy').locate_file(''))
    left_out = set()
    for found in importlib.metadata.distributions(path=[str(site)]):
        name = found.metadata['Name'].lower().replace('-', '_')
        if name.startswith(('ros_', 'llm_astar')):
            left_out |= {Path(file).parts[0] for file in found.files or ()}
    entries = [
        entry
        for entry in site.iterdir()
        if entry.name not in left_out and entry.suffix != '.pth' and entry.name != '__pycache__'
    ]
    for entry in entries:
        (folder / entry.name).symlink_to(entry)
    return len(entries)


def take_compiled(package):
    """Copy what numba has compiled of the same modules here, which takes half a minute there.

    It knows a module by its size and its time. That nothing needs to be there is tested by
    test_compile.py.
    """
    here = Path(llm_astar_planner.__file__).parent
    for path in (*here.rglob('_kernels.py'), *here.rglob('_kernels/*.py')):
        copy = package / path.relative_to(here)
        assert copy.read_bytes() == path.read_bytes()
        os.utime(copy, ns=(path.stat().st_mtime_ns,) * 2)
    for path in here.rglob('__pycache__/*.nb?'):
        copy = package / path.relative_to(here)
        copy.parent.mkdir(exist_ok=True)
        shutil.copy(path, copy)


@pytest.fixture(scope='module')
def user(dist, tmp_path_factory):
    """Run a command of an environment with the wheels and without ROS; its folder is empty."""
    home = tmp_path_factory.mktemp('home')
    venv.create(home / 'venv', with_pip=False, symlinks=True)
    linked = home / 'libraries'
    linked.mkdir()
    if libraries(linked) < 20:
        pytest.skip('the libraries that the wheels need are not installed beside the tests')
    version = f'python{sys.version_info.major}.{sys.version_info.minor}'
    (home / 'venv' / 'lib' / version / 'site-packages' / 'libraries.pth').write_text(f'{linked}\n')
    environment = {
        key: value
        for key, value in os.environ.items()
        if not key.startswith(('PYTHON', 'ROS_', 'AMENT_', '_ROS', 'VIRTUAL_ENV'))
    }
    environment |= {'PIP_NO_INDEX': '1', 'PIP_CONFIG_FILE': os.devnull, 'HOME': str(home)}
    python = home / 'venv' / 'bin' / 'python'
    install = [sys.executable, '-m', 'pip', '--python', python, 'install', '--quiet']
    install += [*dist.glob('*.whl')]
    done = subprocess.run(install, env=environment, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
    take_compiled(home / 'venv' / 'lib' / version / 'site-packages' / 'llm_astar_planner')
    (home / 'work').mkdir()

    def run(*words):
        command = [home / 'venv' / 'bin' / words[0], *words[1:]]
        return subprocess.run(
            command, env=environment, cwd=home / 'work', capture_output=True, text=True
        )

    run.folder, run.environment, run.bin = home / 'work', environment, home / 'venv' / 'bin'
    return run


def test_there_is_no_ros_where_the_wheels_are_installed(user):
    done = user('python', '-c', 'import llm_astar_planner, llm_astar_lab, rclpy')
    assert done.stderr.splitlines()[-1] == "ModuleNotFoundError: No module named 'rclpy'"


def test_one_name_installs_all_three_packages(user):
    names = 'llm-astar-ros', 'llm-astar-planner', 'llm-astar-msgs-adapter', 'llm-astar-lab'
    code = f'from importlib.metadata import version; print(*map(version, {names!r}))'
    assert set(user('python', '-c', code).stdout.split()) == {*versions().values()}


@pytest.mark.timeout(1800)  # where nothing was compiled here, the searches are
def test_the_wheels_plan_keep_an_instruction_and_draw_it(user):
    words = ('--map', 'house', '--robot-radius', '0.2', '--from', 'bedroom', '--to', 'sofa')
    words += ('--instruction', 'stay out of the dining room', '--png', 'plan.png', '--json')
    done = user('llm-astar', 'plan', *words)
    assert done.returncode == 0, done.stderr
    found = json.loads(done.stdout)
    assert found['code'] == 0
    assert found['instruction_report']['clauses'][0]['status'] == 'kept'
    assert (user.folder / 'plan.png').read_bytes().startswith(b'\x89PNG')


def test_the_wheels_open_the_page(user):
    words = ('play', '--no-browser', '--port', '0')
    command, pipe = [user.bin / 'llm-astar', *words], subprocess.PIPE
    with subprocess.Popen(command, env=user.environment, stdout=pipe, text=True) as page:
        try:
            address = re.search(r'http://\S+', page.stdout.readline())[0]
            assert '<html' in httpx.get(address, timeout=60.0).text
        finally:
            page.terminate()


@pytest.mark.slow
def test_the_wheels_measure(user):
    done = user('llm-astar', 'bench', '--limit', '2', '--methods', 'guided', '--out', 'bench')
    assert done.returncode == 0, done.stdout + done.stderr
    assert (user.folder / 'bench' / 'report.html').is_file()


def test_a_command_that_needs_ros_says_so_in_one_line(user):
    done = user('llm-astar', 'call', '--start', '1', '1', '--goal', '2', '2')
    assert done.returncode != 0
    assert done.stderr.startswith("llm-astar: error: No module named 'builtin_interfaces'")
    assert '`llm-astar doctor` says what to install' in done.stderr
    assert done.stderr.count('\n') == 1
