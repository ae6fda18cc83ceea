# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

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
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path

from llm_astar_msgs_adapter.errors import printable

from llm_astar_planner.cli.flags import option
from llm_astar_planner.plugins import LAB, PluginError, Plugins
from llm_astar_planner.resources import find_file


@dataclass(frozen=True)
class Finding:
    """One requirement: whether it was found, and how to install it if it is missing."""

    name: str
    found: bool
    required: bool
    detail: str


# Modules, what needs them and how to install them: of a robot, of the laboratory, of the nodes,
# and optional ones. `distro` is the one that is sourced, or whose wheels `make install` takes.
MODULES = json.loads(Path(__file__).with_name('doctor.json').read_text(encoding='utf-8'))
INSTALL_AGAIN = '{error}; install the package again'


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options."""
    option(parser, '--json', 'print one JSON object')


def run(arguments: argparse.Namespace) -> int:
    """Check, print, and return 0 if nothing required is missing, else 1."""
    findings = list(all_findings())
    sound = all(finding.found or not finding.required for finding in findings)
    if arguments.json:
        print(json.dumps({'ok': sound, 'findings': [asdict(finding) for finding in findings]}))
    else:
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
    yield from module_findings('robot')
    if importlib.util.find_spec(LAB) is not None:
        yield from module_findings('laboratory')
    yield from module_findings('ros')
    yield attempt('rmw', middleware, 'no middleware: {error}')
    yield from module_findings('optional', required=False)
    for folder, name in (('maps', 'demo.json'), ('config', 'planner.yaml')):
        yield attempt(f'{folder}/', partial(folder_of, name, folder), INSTALL_AGAIN)
    yield attempt('searches', compiled, 'do not compile: {kind}: {error}')
    yield attempt('embedded', embedded_model, INSTALL_AGAIN)
    yield from plugin_findings()


def module_findings(group: str, *, required: bool = True) -> Iterator[Finding]:
    """Import the modules of one of the groups of MODULES."""
    distro = os.environ.get('ROS_DISTRO', 'jazzy')
    for name, (use, remedy) in MODULES[group].items():
        yield module_finding(name, use, remedy.format(distro=distro), required=required)


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
    for name in names:
        with suppress(importlib.metadata.PackageNotFoundError):
            return importlib.metadata.version(name)
    return str(getattr(sys.modules[package], '__version__', 'version unknown'))


def attempt(name: str, check: Callable[[], str], failed: str) -> Finding:
    """Find what `check` returns; `failed` is the text for any error that it raises."""
    try:
        return Finding(name, True, True, check())
    except Exception as error:  # noqa: BLE001 - whatever is raised is the finding
        return Finding(name, False, True, failed.format(error=error, kind=type(error).__name__))


def middleware() -> str:
    """Say which RMW implementation would be used."""
    from rclpy.utilities import get_rmw_implementation_identifier  # noqa: PLC0415

    domain = os.environ.get('ROS_DOMAIN_ID', '0')
    return f'{get_rmw_implementation_identifier()}, domain {domain}'


def folder_of(name: str, folder: str) -> str:
    """Find a folder of the package by one of its files."""
    return str(find_file(name, folder).parent)


def compiled() -> str:
    """Compile the searches, which shows whether numba works and can write its cache."""
    from llm_astar_planner.planning.compile import compile_kernels  # noqa: PLC0415

    compile_kernels()
    return 'compiled'


def embedded_model() -> str:
    """Read the weights of the embedded model, a file that an installation may lack."""
    from llm_astar_planner.waypoints import learned  # noqa: PLC0415

    return f'learned waypoint model {learned.packaged_weights().digest}, not an LLM'


def plugin_findings() -> Iterator[Finding]:
    """Load each waypoint source and search method that another package has installed."""
    try:
        from llm_astar_planner.search.methods import SEARCH_METHODS  # noqa: PLC0415
        from llm_astar_planner.waypoints.source import SOURCES  # noqa: PLC0415
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
