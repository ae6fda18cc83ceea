# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""What other packages add to this one, and what a name stands for: its own, a plug-in, or code.

Waypoint sources and search methods are found here. The package's own are listed as
`module:name` and are imported at their first use. Other packages install theirs as entry points
(docs/plugins.md). A plug-in is foreign code: `call` makes one kind of error of what it raises.

`llm_astar.commands` names packages of commands (`COMMANDS` and a module each), `llm_astar.nodes`
the `main` of nodes, and `llm_astar.pictures` what draws for `--png`. llm_astar_lab adds all three;
nothing here imports it.
"""

from __future__ import annotations

import logging
import os
import pkgutil
import sys
import traceback
from collections import defaultdict
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from numbers import Integral
from typing import TYPE_CHECKING, Any, TypeVar

from llm_astar_msgs_adapter import errors

if TYPE_CHECKING:
    from importlib.metadata import EntryPoint


_T = TypeVar('_T')
_LOG = logging.getLogger(__name__)
# Different failures of one plug-in that are logged.
MAX_LOGGED = 5
_LOGGED: defaultdict[str, set[str]] = defaultdict(set)
# Characters of the name of a plug-in, and of the message of an exception that is repeated.
MAX_NAME, MAX_MESSAGE = 200, 300
# The largest count that a plug-in may give.
MAX_COUNT = 2**53


class PluginError(errors.LlmAstarError, ValueError):
    """A plug-in cannot be loaded or has failed; the message names it and says why."""


def call(function: Callable[[], _T]) -> _T:
    """Return what a function of a plug-in returns.

    Raises PluginError where it raises anything, SystemExit included. Ctrl-C stays what it is.
    """
    try:
        return function()
    except KeyboardInterrupt:
        raise
    except BaseException as error:  # noqa: BLE001 - of foreign code, SystemExit too
        problem = description(error)
    raise PluginError(problem)


def log_failure(name: str, problem: Exception) -> None:
    """Log a failure of a plug-in, unless it was logged before or many others were."""
    logged = _LOGGED[name]
    if str(problem) not in logged and len(logged) < MAX_LOGGED:
        logged.add(str(problem))
        _LOG.warning('plug-in %s: %s', name, problem)


def checked_count(value: Any, field: str) -> int:  # noqa: ANN401 - of foreign code
    """Return a count that a plug-in gives as a plain number. Raises PluginError."""
    count = int(value) if isinstance(value, Integral) else -1
    if 0 <= count <= MAX_COUNT:
        return count
    raise PluginError(f'{field}: {errors.short_repr(value)} is not a whole number of 0 or more')


def description(error: BaseException) -> str:
    """Return an exception of foreign code in one line, with the place where it was raised."""
    if isinstance(error, PluginError):
        return str(error)
    name = type(error).__name__
    try:
        name += f': {error}' if str(error) else ''
    except BaseException:  # noqa: BLE001 - its __str__ is foreign code, too
        name += ' without a readable message'
    frames = traceback.extract_tb(error.__traceback__)
    # A module that is not there was not imported by a line of the plug-in's.
    own = (__file__, pkgutil.__file__)
    known = [at for at in frames if at.filename not in own and 'importlib' not in at.filename][-1:]
    where = ''.join(f' ({os.path.basename(at.filename)}, line {at.lineno})' for at in known)
    return errors.printable(errors.shortened(name, MAX_MESSAGE) + where)


@dataclass(frozen=True, eq=False)
class Plugins:
    """The waypoint sources, or the search methods, that a name can stand for.

    `kind` is what they are called in messages, `group` that of the entry points of other
    packages, and `own` has the package's own as `module:name`. What a plug-in's name leads to
    becomes `adapt(name, object)`. `reserved` are more names that no plug-in may take. `loaded` has
    those that were used so far.
    """

    kind: str
    group: str
    own: Mapping[str, str]
    adapt: Callable[[str, Any], Any]
    reserved: frozenset[str] = frozenset()
    loaded: dict[str, Any] = field(default_factory=dict)

    @cached_property
    def installed(self) -> dict[str, list[EntryPoint]]:
        """The entry points of installed packages by name; looked for once in a process."""
        from importlib.metadata import entry_points  # noqa: PLC0415 - takes some milliseconds

        found: dict[str, list[EntryPoint]] = {}
        try:
            for entry in entry_points(group=self.group):
                if entry.name in self.reserved:
                    _LOG.warning('%s %s: the name is taken', self.kind, entry.name)
                    continue
                same = found.setdefault(entry.name, [])
                if entry.value not in [other.value for other in same]:
                    same.append(entry)
        except Exception as error:  # noqa: BLE001 - whatever a damaged package leads to
            _LOG.warning('the plug-ins of installed packages cannot be listed: %s', error)
        return found

    def problem(self, name: object) -> str | None:
        """Say why a name cannot be chosen, None where it can; nothing is imported for that.

        A name with a colon can be chosen only after `admit`, since it imports any code.
        """
        if not isinstance(name, str):
            return f'{errors.short_repr(name)} is not a name'
        if name in self.own or name in self.loaded:
            return None
        if ':' in name:
            where = 'the command line or a parameter file names it at the start'
            return f'{errors.short_repr(name)} names code, which is imported only where {where}'
        entries = self.installed.get(name, [])
        if len(entries) == 1:
            return None
        if not entries:
            names = [*self.own, *self.installed]
            near = errors.nearest_name(name, names)
            return f'{errors.short_repr(name)} is not one of {", ".join(names)}{near}'
        values = ' and '.join(entry.value for entry in entries)
        return f'{errors.short_repr(name)} is installed twice, as {values}: remove one of them'

    def admit(self, name: object) -> None:
        """Import a plug-in that whoever started the process names; ignore all other names.

        After that `package.module:name` can be chosen. It is any code, so it must never come from
        a file of results, a page, or another process. Modules in the working directory are found.
        Raises PluginError.
        """
        if not isinstance(name, str) or name in self.own or name in self.loaded:
            return
        if ':' not in name:
            if name in self.installed:
                self.load(name)
            return
        if len(name) > MAX_NAME or not name.isprintable():
            raise PluginError(f'{errors.short_repr(name)} is not the name of a {self.kind}')
        if os.getcwd() not in sys.path:
            sys.path.append(os.getcwd())
        self.loaded[name] = self._import(name, name)

    def load(self, name: str) -> Any:  # noqa: ANN401 - of any kind
        """Return what a name stands for. Raises PluginError."""
        problem = self.problem(name)
        if problem:
            raise PluginError(f'{self.kind}: {problem}')
        if name in self.own and name not in self.loaded:
            self.loaded[name] = pkgutil.resolve_name(self.own[name])
        elif name not in self.loaded:
            self.loaded[name] = self._import(name, self.installed[name][0].value)
        return self.loaded[name]

    def _import(self, name: str, place: str) -> Any:  # noqa: ANN401 - of any kind
        """Import a plug-in from `module:name`. Raises PluginError."""
        with errors.raising(PluginError, f'{self.kind} {name} cannot be loaded: ', PluginError):
            return call(lambda: self.adapt(name, pkgutil.resolve_name(place)))


LAB = 'llm_astar_lab'
# The names of its commands, for the error where it is not installed.
LAB_COMMANDS = (
    'play', 'bench', 'evaluate', 'instruct-bench', 'report', 'compare', 'draw', 'dataset',
    'record',
)  # fmt: skip


def extensions(kind: str) -> dict[str, EntryPoint]:
    """Return the entry points of the group `llm_astar.KIND`, by name."""
    from importlib.metadata import entry_points  # noqa: PLC0415 - takes some milliseconds

    return {entry.name: entry for entry in entry_points(group=f'llm_astar.{kind}')}


def find_drawing(name: str) -> EntryPoint:
    """Return what draws for a command; loading it imports matplotlib.

    Raises PluginError where the package with it is not installed.
    """
    found = extensions('pictures').get(name)
    if found is None:
        raise not_installed('--png is drawn by code')
    return found


def not_installed(what: str) -> PluginError:
    """Return the error that something is in the laboratory, which is not installed."""
    ways = f'`make install` or `pip install ./src/{LAB}` installs it'
    return PluginError(f'{what} of the package {LAB}, which is not installed; {ways}')
