"""The `llm-astar` command."""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Sequence

from llm_astar_msgs_adapter.barrier_map import BarrierMapError
from llm_astar_msgs_adapter.grid_map import GridMapError

from llm_astar_planner import (
    __version__,
    cli_bench,
    cli_dataset,
    cli_demo,
    cli_doctor,
    cli_draw,
    cli_evaluate,
    cli_plan,
    cli_record,
    cli_report,
    cli_serve,
    cli_speed,
    cli_watch,
)

COMMANDS = (
    cli_plan,
    cli_watch,
    cli_demo,
    cli_bench,
    cli_evaluate,
    cli_report,
    cli_draw,
    cli_dataset,
    cli_record,
    cli_speed,
    cli_doctor,
    cli_serve,
)
# Mistakes in what the user gave: one line on stderr, exit code 2.
USER_ERRORS = (BarrierMapError, GridMapError, OSError, ValueError)

EPILOG = """\
exit codes: 0 done, 1 no plan or something missing, 2 bad usage or input, 3 something was left out,
130 interrupted
"""


def main(argv: Sequence[str] | None = None) -> int:
    """Run one command of `llm-astar`; return its exit code."""
    parser = argparse.ArgumentParser(
        prog='llm-astar',
        description='LLM-A*: plan with the waypoints of a language model, and see what they add.',
        epilog=EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument('--version', action='version', version=f'llm-astar {__version__}')
    commands = parser.add_subparsers(title='commands', metavar='COMMAND', required=True)
    for command in COMMANDS:
        command.add_parser(commands)
    arguments = parser.parse_args(argv)
    try:
        return int(arguments.run(arguments))
    except BrokenPipeError:
        # The reader, `head` say, has seen enough; Python must not flush to it at its exit.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 0
    except USER_ERRORS as error:
        sys.stderr.write(f'llm-astar: error: {error}\n')
        return 2
    except KeyboardInterrupt:
        sys.stderr.write('llm-astar: interrupted\n')
        return 130


if __name__ == '__main__':
    raise SystemExit(main())
