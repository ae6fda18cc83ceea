# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""Start `llm-astar`, or `python -m llm_astar_planner.cli`."""

import atexit
import gc
import os
import signal
import sys

# With these options alone `llm-astar plan` is on the demo's map, where Python searches sooner than
# numba is imported.
OF_DEMO = {'--json', '--png', '--pair', '--map-id', '--start', '--goal', '--reply'}
# Container objects that are made before garbage is looked for; Python's default is 700.
COLLECTED_AT = 50_000


def main() -> int:
    """Run a command; return its exit code.

    Until its modules are imported there is nothing to clean up: Ctrl-C just ends the process.
    """
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    # Modules and kernels are no garbage: to look for it in them, at the end too, takes a quarter
    # of the time of `llm-astar plan`.
    gc.set_threshold(COLLECTED_AT)
    atexit.register(gc.freeze)
    command, options = sys.argv[1:2], {word.partition('=')[0] for word in sys.argv[2:]}
    if command == ['plan'] and {word for word in options if word[:2] == '--'} <= OF_DEMO:
        os.environ.setdefault('NUMBA_DISABLE_JIT', '1')
    from llm_astar_planner.cli.main import main as run_command  # noqa: PLC0415

    return run_command()


if __name__ == '__main__':
    raise SystemExit(main())
