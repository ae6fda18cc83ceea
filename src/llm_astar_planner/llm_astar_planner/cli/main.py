# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""LLM-A*: plan with the waypoints of a language model, and measure what they add.

first steps:
  llm-astar plan                 plan on the demo map and print what came of it
  llm-astar play                 do it in the browser
  llm-astar run                  start the nodes; `llm-astar call` asks them
  llm-astar COMMAND --help       examples, options and units of a command
"""

from __future__ import annotations

import argparse
import importlib
import io
import os
import re
import signal
import sys
import threading
from collections.abc import Sequence
from typing import Any, NoReturn

from llm_astar_msgs_adapter.errors import LlmAstarError, nearest_name, printable

from llm_astar_planner import __version__
from llm_astar_planner.parameter import ParameterError
from llm_astar_planner.plugins import LAB_COMMANDS, extensions, not_installed

# Each command is a module of its name (with _ for -), with its help as docstring, `add_arguments`
# and `run`. It is imported only for that command: `doctor` must run where what the others need is
# missing.
COMMANDS = {
    'plan': 'plan from start to goal on a map, without ROS',
    'places': 'check, list and draw the named places of a map',
    'mcp': 'serve route planning to agents over MCP',
    'run': 'run map, waypoint client and planner as nodes until Ctrl-C',
    'call': 'ask a running planner for a plan, or what an instruction means',
    'param': 'list, read and set the parameters of running nodes',
    'watch': 'print the plans of a running planner as they are made',
    'doctor': 'check what is installed, what is missing, and how to install it',
}
EXIT_CODES = """\
exit codes: 0 done, 1 no plan or something missing, 2 bad usage or input, 3 something was left out,
130 interrupted
"""

OWN = 'llm_astar_planner.cli'
# Seconds until an interruption that was lost is raised again.
AGAIN_S = 0.02


class Parser(argparse.ArgumentParser):
    """A parser whose errors are one line, as all others of the command are."""

    def error(self, message: str) -> NoReturn:
        """Raise ParameterError instead of printing all options and ending the process."""
        message = message.replace('invalid float value', 'not a number')
        message = message.replace('invalid int value', 'not a whole number')
        raise ParameterError(f'{message}; `{self.prog} --help` lists the options')


def main(argv: Sequence[str] | None = None) -> int:
    """Run one command of `llm-astar`; return its exit code."""
    argv = sys.argv[1:] if argv is None else list(argv)
    if isinstance(sys.stdout, io.TextIOWrapper):
        # Not every terminal can write arrows and degrees.
        sys.stdout.reconfigure(errors='replace')
    try:
        arguments = parse(argv or ['--help'])
        return run_interruptibly(arguments)
    except BrokenPipeError:
        # The reader, such as `head`, has closed the pipe; Python must not write to it at exit.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 0
    except ImportError as error:
        return fail(f'{error}; `llm-astar doctor` says what to install', 1)
    except OSError as error:
        named = error.filename is not None and error.strerror
        return fail(f'{error.filename}: {error.strerror}' if named else str(error), 2)
    except (LlmAstarError, ValueError) as error:
        return fail(str(error), 2)
    except KeyboardInterrupt:
        sys.stderr.write('llm-astar: interrupted\n')
        return 130


def run_interruptibly(arguments: argparse.Namespace) -> int:
    """Run a parsed command; raise KeyboardInterrupt for whatever Ctrl-C makes of it.

    A second Ctrl-C, during the cleanup, just ends the process.
    """
    interrupts: list[int] = []

    def interrupt(number: int, _: object) -> None:
        interrupts.append(number)
        signal.signal(number, signal.SIG_DFL)
        raise KeyboardInterrupt

    def raise_again(lost: sys.UnraisableHookArgs) -> None:
        # Raised within a destructor, which is not ours, it is not passed on.
        if not isinstance(lost.exc_value, KeyboardInterrupt):
            sys.__unraisablehook__(lost)
            return
        signal.signal(signal.SIGINT, interrupt)
        again = threading.Timer(AGAIN_S, os.kill, (os.getpid(), signal.SIGINT))
        again.daemon = True
        again.start()

    if signal.getsignal(signal.SIGINT) is signal.SIG_DFL:  # as `__main__` leaves it
        signal.signal(signal.SIGINT, interrupt)
        sys.unraisablehook = raise_again
    try:
        return int(arguments.run(arguments))
    except Exception:
        # An interrupted import may fail in any way.
        if interrupts:
            raise KeyboardInterrupt from None
        raise


def parse(argv: Sequence[str]) -> argparse.Namespace:
    """Return the parsed options of the command that `argv` begins with.

    Raises ParameterError for what cannot be parsed.
    """
    as_written: Any = {'formatter_class': argparse.RawDescriptionHelpFormatter}
    parser = Parser(prog='llm-astar', **help_texts(__doc__), **as_written)
    parser.add_argument('--version', action='version', version=f'llm-astar {__version__}')
    commands = parser.add_subparsers(title='commands', metavar='COMMAND', required=True)
    for name, (package, summary) in installed_commands(argv[0]).items():
        if argv[:1] == [name]:
            module = importlib.import_module(f'{package}.{name.replace("-", "_")}')
            texts = help_texts(module.__doc__ or '')
            command = commands.add_parser(name, **texts, **as_written)
            command.set_defaults(run=module.run, command=name)
            module.add_arguments(command)
        else:
            commands.add_parser(name, help=summary)
    arguments, unknown = parser.parse_known_args(argv)
    if unknown:
        command = commands.choices.get(argv[0], parser)
        known = re.findall(r'--[a-z][a-z-]*', command.format_help())
        near = nearest_name(unknown[0].partition('=')[0], known)
        raise ParameterError(f'{command.prog} has no option {unknown[0]}{near}')
    return arguments


def help_texts(doc: str) -> dict[str, Any]:
    """Return the texts of a help by their names in argparse; `doc` is the docstring with them.

    After the description that may have a paragraph `usage: ...`, and then what ends the help,
    from the first line that is a heading with a colon; it always says what exit codes mean.
    """
    heading = re.search(r'(?m)^[\w ]+:$', doc)
    begin = heading.start() if heading else len(doc) + 1
    description, _, usage = doc[: begin - 1].partition('\nusage: ')
    usage, end = usage.rstrip('\n'), doc[begin:]
    end = end if 'exit codes:' in end else f'{end}\n{EXIT_CODES}'.lstrip()
    return {'description': description, 'epilog': end} | ({'usage': usage} if usage else {})


def installed_commands(wanted: str) -> dict[str, tuple[str, str]]:
    """Return the package of modules and the summary of each command, by name.

    Those of other packages are looked up only where `wanted` is none of ours. Raises
    PluginError where it is a command of a package that is not installed.
    """
    found = {name: (OWN, summary) for name, summary in COMMANDS.items()}
    if wanted in found:
        return found
    for package in extensions('commands').values():
        commands = package.load()
        found |= {name: (commands.__name__, text) for name, text in commands.COMMANDS.items()}
    if wanted not in found and wanted in LAB_COMMANDS:
        raise not_installed(f'{wanted} is a command')
    return found


def fail(message: str, code: int) -> int:
    """Print an error in one line; return its exit code."""
    sys.stderr.write(f'llm-astar: error: {printable(message)}\n')
    return code


if __name__ == '__main__':
    raise SystemExit(main())
