# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""A dataset's samples as a bag, and the exchanges of bags as a transcript.

Exchanges with language models that were recorded in bags become a transcript to replay.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from itertools import groupby
from pathlib import Path
from typing import Any

from llm_astar_msgs_adapter.maps.barrier_map import BarrierMap
from llm_astar_msgs_adapter.maps.grid_map import Pose2D
from llm_astar_msgs_adapter.messages.fields import values_of_report
from llm_astar_planner.waypoints.prompts.reply_parser import read_answer
from llm_astar_planner.waypoints.transcript import Exchange, TranscriptWriter, parse_exchange

from llm_astar_lab.bags import types as bag_messages
from llm_astar_lab.bags.reading import Bag
from llm_astar_lab.bags.types import BARRIER_MAP, GET_PLAN_EVENT, MAP, NANOSECONDS, define
from llm_astar_lab.bags.writing import LATCHED, BagWriter, OfferedTopic, qos
from llm_astar_lab.datasets.named import BenchmarkSample
from llm_astar_lab.evaluation.requests import TopicSelection, topic_roles

GRID = 'nav_msgs/msg/OccupancyGrid'
# The time of a sample bag's first map; it is fixed, so that the same samples give the same bag.
FIRST_STAMP = 1_700_000_000 * NANOSECONDS
# The time from each map or request of a sample bag to the next.
STEP = NANOSECONDS
# How long barriers come before their map.
LEAD = NANOSECONDS // 1000


def write_sample_bag(samples: Iterable[BenchmarkSample], folder: str | Path) -> dict[str, int]:
    """Write samples, in their order, as a bag; return the number of messages by topic.

    Each map is an OccupancyGrid, with its barriers as JSON just before it if it has any; each
    sample is a request of GetPlan, a second after the one before. The same samples give the same
    bag. Raises BagWriteError where the folder exists or the disk is full, OSError where the folder
    cannot be made.
    """
    with BagWriter(folder) as bag:
        bag.add_topic(OfferedTopic(BARRIER_MAP, define('std_msgs/msg/String'), (LATCHED,)))
        bag.add_topic(OfferedTopic(MAP, define(GRID), (LATCHED,)))
        event = define(bag_messages.GET_PLAN_EVENT_TYPE)
        bag.add_topic(OfferedTopic(GET_PLAN_EVENT, event, (qos(),)))
        stamp, number = FIRST_STAMP, 0
        for _, of_map in groupby(samples, key=lambda sample: sample.barrier_map.id):
            group = list(of_map)
            problem = group[0].barrier_map
            if isinstance(problem, BarrierMap):
                whole = replace(problem, samples=tuple(sample.sample for sample in group))
                text = bag_messages.barrier_map_text(whole)
                bag.write_message(BARRIER_MAP, stamp - LEAD, text)
            grid_map = problem.to_grid()
            bag.write_message(MAP, stamp, bag_messages.occupancy_grid(grid_map, stamp))
            for sample in group:
                stamp, number = stamp + STEP, number + 1
                cells = [problem.to_cell(sample.sample.start), problem.to_cell(sample.sample.goal)]
                start, goal = (Pose2D(*point) for point in grid_map.grid_to_world(cells).tolist())
                facts = grid_map.frame_id, stamp, number
                request = bag_messages.get_plan_request(start, goal, *facts)
                bag.write_message(GET_PLAN_EVENT, stamp, request)
            stamp += STEP
    return bag.counts


def write_exchanges(bags: Sequence[Bag], selection: TopicSelection, transcript: Path) -> int:
    """Write every exchange in bags to a new transcript, in their order; return their number.

    Raises TranscriptError or OSError where the file cannot be written.
    """
    transcript.unlink(missing_ok=True)
    writer = TranscriptWriter(transcript)
    count = 0
    for bag in bags:
        roles = topic_roles(bag, selection)
        for message in bag.messages([name for name, role in roles.items() if role == 'exchange']):
            exchange = exchange_from_values(values_of_report(message.value))
            if exchange is not None:
                writer.write(exchange)
                count += 1
    return count


def exchange_from_values(values: Mapping[str, Any]) -> Exchange | None:
    """Make an exchange of a message's values; None where they are not those of an exchange."""
    try:
        response, unit = response_of(values)
        messages = [{'role': role, 'content': text} for role, text in values['messages']]
        own = {'response': response, 'unit': unit, 'messages': messages}
        return parse_exchange({**values, 'map': values['map_digest'], 'scale': 1, **own})
    except (KeyError, TypeError, ValueError, OverflowError):
        return None


def response_of(values: Mapping[str, Any]) -> tuple[str, int]:
    """Return the reply's text, and how many cells one step of its coordinates is.

    The message has the waypoints too. Where the text does not give the same ones, since it was
    cut, is in other units, or the source has no text, the response is their list in cells.
    """
    text, unit = str(values['text']), int(values['unit'])
    points = tuple((float(x), float(y)) for x, y in values['waypoints'])
    if not points or (unit == 1 and read_answer(text).waypoints == points):
        return text, unit
    return json.dumps(points), 1
