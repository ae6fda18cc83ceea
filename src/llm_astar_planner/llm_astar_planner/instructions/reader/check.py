# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""Whether a reading of a sentence may be claimed, whoever proposes it.

Three networks that were trained apart have to find it likely, and rules that know nothing of them
must find no doubt.
"""

from collections.abc import Mapping, Sequence
from typing import Any

from llm_astar_msgs_adapter.maps.places import Places

from llm_astar_planner.instructions.reader import claims
from llm_astar_planner.instructions.reader.lifting import Lifted, lifted
from llm_astar_planner.instructions.reader.meaning import Unreadable, ordered
from llm_astar_planner.instructions.reader.translation import Translation
from llm_astar_planner.instructions.reader.views import Clauses, Views

LONGEST = 64
# The least log probability and log odds of a claim, calibrated on sentences that were locked.
LIKELY, AGREED = -1.0, 2.0


def doubt_about(text: str, places: Places, clauses: Sequence[Mapping[str, Any]]) -> str:
    """Return why clauses in JSON may not be claimed of a clean text, '' where they may."""
    one = lifted(text, places)
    if not 0 < len(one.tokens) <= LONGEST:
        return f'more than {LONGEST} words'
    try:
        meaning = ordered(Translation(one.slots, places).meaning(clauses))
    except Unreadable as error:
        return str(error)
    return doubt(one, meaning, Views(one))


def doubt(one: Lifted, clauses: Clauses, views: Views) -> str:
    """Return why a meaning is not certain, '' where it is."""
    weight = views.weigh(clauses)
    if weight.likely < LIKELY or weight.agreed < AGREED:
        return 'the networks do not agree on it'
    return claims.doubt(one, clauses)
