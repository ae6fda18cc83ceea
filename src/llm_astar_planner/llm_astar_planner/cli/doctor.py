"""Check everything that the planner uses, and say how to install what is missing.

The exit code is 1 if something required is missing.
"""

from __future__ import annotations

import argparse
import importlib
import importlib.metadata
import importlib.util
import json
import os
import platform
import sys
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from pathlib import Path

from llm_astar_msgs_adapter.errors import printable

from llm_astar_planner.extensions import LAB
from llm_astar_planner.plugins import PluginError, Plugins
from llm_astar_planner.resources import find_file


@dataclass(frozen=True)
class Finding:
    """One requirement: whether it was found, and how to install it if it is missing."""

    name: str
    found: bool
    required: bool
    detail: str


# Modules of Python packages by what needs them, and the names on PyPI that differ.
LIBRARIES = {
    'the core': ('numpy',),
    'caches': ('cachetools',),
    'the searches': ('numba',),
    'the planner': ('scipy', 'shapely'),
    'map images': ('PIL',),
    'map and parameter files': ('yaml',),
    'language models': ('httpx',),
    'instructions': ('lark', 'rapidfuzz'),
}
# Those of the laboratory, which a robot needs no part of.
LAB_LIBRARIES = {
    'pictures': ('matplotlib',),
    'benchmarks': ('duckdb', 'jinja2', 'tqdm'),
    'bags': ('rosbags.rosbag2', 'mcap', 'zstandard', 'lz4.frame'),
    'llm-astar play': ('starlette', 'uvicorn'),
}
PYPI_NAMES = {'PIL': 'pillow', 'yaml': 'pyyaml'}
# The distribution that is sourced, or the one whose wheels `make install` takes by default.
DISTRIBUTION = os.environ.get('ROS_DISTRO', 'jazzy')
# Modules that the nodes need, and the Debian packages with them.
ROS = {
    'rclpy.node': f'ros-{DISTRIBUTION}-rclpy',
    'nav_msgs.msg': f'ros-{DISTRIBUTION}-common-interfaces',
    'diagnostic_msgs.msg': f'ros-{DISTRIBUTION}-common-interfaces',
    'visualization_msgs.msg': f'ros-{DISTRIBUTION}-common-interfaces',
}
# Modules of optional ROS packages: what needs them, and the Debian packages with them.
OPTIONAL_ROS = {
    'launch_ros': ('ros2 launch', f'ros-{DISTRIBUTION}-launch-ros'),
    'nav2_msgs.action': ("Nav2's actions", f'ros-{DISTRIBUTION}-nav2-msgs'),
    'bond.msg': ("Nav2's lifecycle manager", f'ros-{DISTRIBUTION}-bond'),
    'tf2_ros': ('poses of other frames', f'ros-{DISTRIBUTION}-tf2-ros-py'),
    'map_msgs.msg': ('map_updates', f'ros-{DISTRIBUTION}-map-msgs'),
    'ros2cli': ('ros2 run', f'ros-{DISTRIBUTION}-ros2cli'),
}


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options."""
    parser.add_argument('--json', action='store_true', help='print one JSON object')


def run(arguments: argparse.Namespace) -> int:
    """Check, print, and return 0 if nothing required is missing, else 1."""
    findings = list(all_findings())
    sound = all(finding.found or not finding.required for finding in findings)
    if arguments.json:
        print(json.dumps({'ok': sound, 'findings': [asdict(finding) for finding in findings]}))
        return 0 if sound else 1
    width = max(len(finding.name) for finding in findings)
    for finding in findings:
        mark = 'ok      ' if finding.found else 'MISSING ' if finding.required else 'absent  '
        print(f'{mark} {finding.name:{width}}  {finding.detail}')
    missing = 'something required is missing: see above'
    print('everything required is installed' if sound else missing)
    return 0 if sound else 1


def all_findings() -> Iterator[Finding]:
    """Check everything, one finding each."""
    version = platform.python_version()
    fits = (3, 10) <= sys.version_info[:2] <= (3, 13)
    yield Finding('python', fits, True, f'{version}, {sys.executable} (3.10 to 3.13 are tried)')
    has_lab = importlib.util.find_spec(LAB) is not None
    for use, names in (LIBRARIES | (LAB_LIBRARIES if has_lab else {})).items():
        for name in names:
            package = name.partition('.')[0]
            remedy = f'pip install {PYPI_NAMES.get(package, package)}'
            yield module_finding(name, use, remedy, required=True)
    for name, debian in ROS.items():
        remedy = f'apt install {debian}, or make install for the wheels'
        yield module_finding(name, 'the nodes', remedy, required=True)
    yield middleware_finding()
    use = 'the speed of the embedded model on a busy machine'
    remedy = 'pip install threadpoolctl, or apt install python3-threadpoolctl'
    yield module_finding('threadpoolctl', use, remedy, required=False)
    yield module_finding(
        'mcp.server.mcpserver', 'llm-astar mcp', "pip install 'mcp>=2'", required=False
    )
    use = 'benchmarks, bags, pictures and the page in the browser'
    yield module_finding(LAB, use, f'pip install ./src/{LAB}', required=False)
    for name, (use, debian) in OPTIONAL_ROS.items():
        remedy = f'apt install {debian}; there is no wheel'
        yield module_finding(name, use, remedy, required=False)
    for folder, name in (('maps', 'demo.json'), ('config', 'planner.yaml')):
        yield file_finding(folder, name)
    yield kernels_finding()
    yield weights_finding()
    yield from plugin_findings()


def module_finding(name: str, use: str, remedy: str, *, required: bool) -> Finding:
    """Import a module; a submodule too, since an empty folder of its name can be imported."""
    package = name.partition('.')[0]
    try:
        importlib.import_module(name)
    except ImportError:
        return Finding(package, False, required, f'needed for {use}: {remedy}')
    module = sys.modules[package]
    # A folder, or a single file as threadpoolctl is.
    place = next(iter(getattr(module, '__path__', [module.__file__])))
    return Finding(package, True, required, f'{version_of(package)} in {Path(place).parent}')


def version_of(package: str) -> str:
    """Return the version of an imported package."""
    # The ROS wheels are named ros-*, and carry older metadata under the plain name.
    names = (f'ros-{package.replace("_", "-")}', package)
    known = {item.metadata['Name'] for item in importlib.metadata.distributions()}
    found = next((name for name in names if name in known), None)
    if found is not None:
        return importlib.metadata.version(found)
    return str(getattr(sys.modules[package], '__version__', 'version unknown'))


def middleware_finding() -> Finding:
    """Find which RMW implementation would be used."""
    try:
        from rclpy.utilities import get_rmw_implementation_identifier  # noqa: PLC0415

        identifier = get_rmw_implementation_identifier()
    except (ImportError, RuntimeError) as error:
        return Finding('rmw', False, True, f'no middleware: {error}')
    domain = os.environ.get('ROS_DOMAIN_ID', '0')
    return Finding('rmw', True, True, f'{identifier}, domain {domain}')


def file_finding(folder: str, name: str) -> Finding:
    """Find a folder of the package by one of its files."""
    try:
        return Finding(f'{folder}/', True, True, str(find_file(name, folder).parent))
    except FileNotFoundError as error:
        return Finding(f'{folder}/', False, True, f'{error}; install the package again')


def kernels_finding() -> Finding:
    """Compile the searches, which shows whether numba works and can write its cache."""
    try:
        from llm_astar_planner.planning.compile import compile_kernels  # noqa: PLC0415

        compile_kernels()
    except Exception as error:  # noqa: BLE001 - whatever numba raises is the finding
        return Finding('searches', False, True, f'do not compile: {type(error).__name__}: {error}')
    return Finding('searches', True, True, 'compiled')


def weights_finding() -> Finding:
    """Read the weights of the embedded model, a file that an installation may lack."""
    try:
        from llm_astar_planner.waypoints.learned import network  # noqa: PLC0415

        digest = network.packaged_weights().digest
    except (ImportError, OSError, ValueError) as error:
        return Finding('embedded', False, True, f'{error}; install the package again')
    return Finding('embedded', True, True, f'learned waypoint model {digest}, not an LLM')


def plugin_findings() -> Iterator[Finding]:
    """Load each waypoint source and search method that another package has installed."""
    try:
        from llm_astar_planner.search.methods import SEARCH_METHODS  # noqa: PLC0415
        from llm_astar_planner.waypoints.plugins import SOURCES  # noqa: PLC0415
    except ImportError:
        return  # found missing above
    for plugins in (SOURCES, SEARCH_METHODS):
        for name in plugins.installed:
            yield plugin_finding(plugins, name)


def plugin_finding(plugins: Plugins, name: str) -> Finding:
    """Load one plug-in, which nothing else needs."""
    entries = plugins.installed[name]
    detail = f'{plugins.kind} {" and ".join(entry.value for entry in entries)}'
    package = entries[0].dist
    if package is not None:
        detail += f' of {package.name} {package.version}'
    problem = ''
    if name in plugins.own:
        problem = ': cannot be chosen, since llm-astar has one of this name'
    else:
        try:
            plugins.load(name)
        except PluginError as error:
            problem = f': {error}'
    return Finding(printable(name), not problem, False, printable(detail + problem))
