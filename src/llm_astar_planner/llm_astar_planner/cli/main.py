"""The `llm-astar` command."""

from __future__ import annotations

import argparse
import importlib
import os
import sys
from collections.abc import Sequence

from llm_astar_planner import __version__

# A command's module has its name and is imported for the command that is run alone: `doctor`
# must run where what the others need is missing.
COMMANDS = {
    'plan': 'plan from start to goal on a map, without ROS',
    'watch': 'print the plans of a running planner as they are made',
    'demo': 'start the graph, ask for a plan, draw it, stop the graph',
    'bench': 'run methods with and without waypoints over a dataset',
    'evaluate': 'plan what recorded bags asked for, and compare',
    'report': 'write the reports of a results folder anew',
    'draw': 'draw A* beside LLM-A* on one sample',
    'dataset': 'make, check or convert datasets',
    'record': 'record maps, requests, plans and exchanges of the live graph into a bag',
    'doctor': 'what is installed, what is missing, how to get it',
}

EPILOG = """\
exit codes: 0 done, 1 no plan or something missing, 2 bad usage or input, 3 something was left out,
130 interrupted
"""


def main(argv: Sequence[str] | None = None) -> int:
    """Run one command of `llm-astar`; return its exit code."""
    argv = sys.argv[1:] if argv is None else list(argv)
    try:
        arguments = _parser(argv).parse_args(argv)
        return int(arguments.run(arguments))
    except BrokenPipeError:
        # The reader, `head` say, has seen enough; Python must not flush to it at its exit.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 0
    except ImportError as error:
        return _fail(f'{error}; `llm-astar doctor` tells what to install', 1)
    except OSError as error:
        named = error.filename is not None and error.strerror
        return _fail(f'{error.filename}: {error.strerror}' if named else str(error), 2)
    except ValueError as error:
        return _fail(str(error), 2)
    except KeyboardInterrupt:
        sys.stderr.write('llm-astar: interrupted\n')
        return 130


def _parser(argv: Sequence[str]) -> argparse.ArgumentParser:
    """Make the parser, with the options of the command that `argv` begins with."""
    parser = argparse.ArgumentParser(
        prog='llm-astar',
        description='LLM-A*: plan with the waypoints of a language model, and see what they add.',
        epilog=EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument('--version', action='version', version=f'llm-astar {__version__}')
    commands = parser.add_subparsers(title='commands', metavar='COMMAND', required=True)
    for name, summary in COMMANDS.items():
        if argv[:1] == [name]:
            module = f'llm_astar_planner.cli.{name}'
            importlib.import_module(module).add_parser(commands)
        else:
            commands.add_parser(name, help=summary)
    return parser


def _fail(message: str, code: int) -> int:
    sys.stderr.write(f'llm-astar: error: {message}\n')
    return code


if __name__ == '__main__':
    raise SystemExit(main())
