# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""Record the live graph into a rosbag2 bag, to evaluate it later.

examples:
  llm-astar record --out run1                                   until Ctrl-C
  llm-astar record --out run2 --duration 600                    ten minutes
  llm-astar record --out run3 --namespace /robot1 --topics scan amcl_pose

Records maps and their updates, requests of GetPlan, goals and initial poses, plans, the planner's
reports, exchanges with the language model, tf, odometry and diagnostics. What has no publisher yet
is waited for. For the use of the bag see `llm-astar evaluate --help`.
"""

import argparse
import math
from functools import partial

from llm_astar_planner.cli.flags import at_least, option

from llm_astar_lab.bags.writing import BagWriter


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options."""
    option(parser, '--out DIR', 'the bag, a new folder', required=True)
    option(parser, '--namespace NAME', "the robot's, such as /robot1", default='')
    option(parser, '--topics NAME', 'further topics to record', nargs='+', default=[])
    text = 'stop after this time (default: at Ctrl-C)'
    option(parser, '--duration SECONDS', text, default=math.inf, type=at_least(0.001))


def run(arguments: argparse.Namespace) -> int:
    """Record; return 0, or 1 where no message came. Raises BagWriteError, OSError."""
    # Not at the top, so that `--help` works without ROS.
    from llm_astar_lab.nodes.recorder import TOPICS, record  # noqa: PLC0415

    bag = BagWriter(arguments.out)
    topics = (*TOPICS, *arguments.topics)
    report = partial(print, flush=True)
    record(bag, topics, arguments.namespace, arguments.duration, report)
    for topic, count in bag.counts.items():
        print(f'{count:8d} {topic}')
    print(f'{arguments.out}: {bag.total} messages')
    return 0 if bag.total else 1
