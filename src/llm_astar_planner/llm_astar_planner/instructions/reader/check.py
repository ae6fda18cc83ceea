# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""Whether a reading of a sentence may be claimed, whoever proposes it.

Networks that were trained apart have all to find it likely, and rules that know nothing of them
must find no doubt.
"""

from collections.abc import Mapping, Sequence
from functools import lru_cache
from typing import Any

from llm_astar_msgs_adapter.maps.places import Places

from llm_astar_planner.instructions.reader import claims
from llm_astar_planner.instructions.reader.lifting import Lifted, lifted
from llm_astar_planner.instructions.reader.meaning import Unreadable, ordered
from llm_astar_planner.instructions.reader.translation import Translation
from llm_astar_planner.instructions.reader.views import Clauses, Views

LONGEST = 64
# The least weight of a claim, set with locked sentences in sight, see docs/reader.md.
CERTAIN = 0.05


def doubt_about(text: str, places: Places, clauses: Sequence[Mapping[str, Any]]) -> str:
    """Return why clauses in JSON may not be claimed of a clean text, '' where they may."""
    try:
        one, views = viewed(text, places)
        return doubt(one, ordered(Translation(one.slots, places).meaning(clauses)), views)
    except Unreadable as error:
        return str(error)


@lru_cache(maxsize=4)
def viewed(text: str, places: Places) -> tuple[Lifted, Views]:
    """Return a clean text with slots, and as the networks read it. Raises Unreadable."""
    one = lifted(text, places)
    if not 0 < len(one.tokens) <= LONGEST:
        raise Unreadable(f'more than {LONGEST} words')
    return one, Views(one)


def doubt(one: Lifted, clauses: Clauses, views: Views) -> str:
    """Return why a meaning is not certain, '' where it is."""
    is_certain = views.weigh(clauses).all >= CERTAIN
    return claims.doubt(one, clauses) if is_certain else 'the networks do not agree on it'
