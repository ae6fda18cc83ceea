# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""Start `llm-astar`, or `python -m llm_astar_planner.cli`."""

import signal


def main() -> int:
    """Run a command; return its exit code.

    Until its modules are imported there is nothing to clean up: Ctrl-C just ends the process.
    """
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    from llm_astar_planner.cli.main import main as run_command  # noqa: PLC0415

    return run_command()


if __name__ == '__main__':
    raise SystemExit(main())
