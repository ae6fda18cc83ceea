"""What is imported is declared, and what a robot needs is what rosdep can install."""

import ast
import configparser
import re
import sys
from functools import cache
from pathlib import Path
from xml.etree import ElementTree

import pytest

ROOT = Path(__file__).resolve().parents[1]
ADAPTER, PLANNER, LAB = PACKAGES = (
    'llm_astar_msgs_adapter', 'llm_astar_planner', 'llm_astar_lab',
)  # fmt: skip
# Modules with the name of their distribution, where that differs.
DISTRIBUTIONS = {'PIL': 'pillow', 'lark': 'lark-parser', 'yaml': 'pyyaml'}
# What another library depends on or is a part of: numba compiles by llvmlite.
PARTS = {
    'llvmlite': 'numba', 'markupsafe': 'jinja2', 'mpl_toolkits': 'matplotlib', 'pydantic': 'mcp',
}  # fmt: skip
# Distributions with the key of rosdep, where that is not python3-NAME.
KEYS = {'pillow': 'python3-pil', 'pyyaml': 'python3-yaml'}
# Distributions without a key, and what happens without each.
OPTIONAL = {'threadpoolctl': 'the embedded model is slower on a busy machine', 'mcp': 'no `mcp`'}
BY_PIP = {'duckdb', 'lz4', 'mcap', 'rosbags', 'starlette', 'zstandard'}
FOR_TYPES = {'typing_extensions'}
# Of setuptools, which finds the entry points of a colcon workspace.
BUILD = {'setuptools'}


def folder(package):
    return ROOT / 'src' / package


def keys():
    lines = (ROOT / 'test' / 'data' / 'rosdep_keys.txt').read_text().splitlines()
    return {line for line in lines if not line.startswith('#')}


def manifest(package, *kinds):
    root = ElementTree.parse(folder(package) / 'package.xml').getroot()
    return {one.text for kind in kinds for one in root.findall(kind)}


@cache
def imported(package):
    """Return the first names of what the modules and launch files of a package import."""
    names = set()
    files = (*folder(package).glob('launch/*.py'), *(folder(package) / package).rglob('*.py'))
    for path in files:
        for node in ast.walk(ast.parse(path.read_text(encoding='utf-8'))):
            if isinstance(node, ast.Import):
                names.update(alias.name.partition('.')[0] for alias in node.names)
            elif isinstance(node, ast.ImportFrom):
                names.add(node.module.partition('.')[0])
    return names - set(sys.stdlib_module_names) - FOR_TYPES - {package}


def is_ros(name):
    return name in keys() or name == 'tf2_ros'


def required(package, *, with_extras=False):
    """Return the distributions that a package asks pip for, without their versions."""
    setup = configparser.ConfigParser()
    setup.read(folder(package) / 'setup.cfg')
    lists = [setup['options']['install_requires']]
    lists += setup['options.extras_require'].values() if with_extras else []
    lines = '\n'.join(lists).splitlines()
    found = {re.split('[<>=]', line)[0] for line in lines if line and not line.startswith('#')}
    return found - BUILD


@pytest.mark.parametrize('package', [ADAPTER, PLANNER])
def test_rosdep_can_install_all_that_a_robot_needs(package):
    kinds = ('depend', 'build_depend', 'exec_depend', 'test_depend', 'buildtool_depend')
    assert manifest(package, *kinds) - {*PACKAGES} <= keys()


def test_rosdep_can_install_all_that_the_laboratory_names():
    assert manifest(LAB, 'exec_depend', 'test_depend') - {*PACKAGES} <= keys()


@pytest.mark.parametrize('package', PACKAGES)
def test_every_library_that_is_imported_is_declared_for_pip(package):
    libraries = {name for name in imported(package) if not is_ros(name)}
    asked = {DISTRIBUTIONS.get(name) or PARTS.get(name, name) for name in libraries}
    assert asked <= required(package, with_extras=True)


@pytest.mark.parametrize('package', PACKAGES)
def test_every_library_that_pip_installs_is_one_that_is_imported(package):
    asked = {DISTRIBUTIONS.get(name) or PARTS.get(name, name) for name in imported(package)}
    assert required(package) <= asked


@pytest.mark.parametrize('package', PACKAGES)
def test_every_library_that_pip_installs_is_declared_for_rosdep(package):
    libraries = required(package) - {*PACKAGES} - OPTIONAL.keys()
    if package == LAB:
        libraries -= BY_PIP
    wanted = {KEYS.get(name, f'python3-{name}') for name in libraries}
    assert wanted <= manifest(package, 'exec_depend')


@pytest.mark.parametrize('package', PACKAGES)
def test_every_ros_package_that_is_imported_is_declared(package):
    names = {name for name in imported(package) if is_ros(name)}
    names = {'tf2_ros_py' if name == 'tf2_ros' else name for name in names}
    assert names <= manifest(package, 'exec_depend')


def test_what_has_no_key_is_not_imported_where_a_robot_starts():
    """A robot that rosdep has installed lacks these, and plans all the same."""
    for path in (folder(PLANNER) / PLANNER).rglob('*.py'):
        tree = ast.parse(path.read_text(encoding='utf-8'))
        for node in tree.body:
            if isinstance(node, (ast.Import, ast.ImportFrom)):
                names = [alias.name for alias in node.names]
                names.append(getattr(node, 'module', '') or '')
                heads = {name.partition('.')[0] for name in names}
                assert path.stem.startswith('mcp') or not heads & OPTIONAL.keys(), path
