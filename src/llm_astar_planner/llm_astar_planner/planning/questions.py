# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""Questions about a path: "why not through the kitchen?", "what if the door were open?".

The problem that a question names is solved exactly, and so is the one that was asked; the answer
compares both, in the language of the question. Regions are read by the grammar of instructions.
"""

import math
import re
from collections.abc import Iterator
from dataclasses import replace
from itertools import islice
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from llm_astar_msgs_adapter.errors import LlmAstarError, raising
from llm_astar_msgs_adapter.files import read_yaml
from llm_astar_msgs_adapter.maps.grid_map import FREE, GridMap
from llm_astar_msgs_adapter.maps.places import NO_PLACES, Places

from llm_astar_planner.instructions.clauses.avoid import Avoid
from llm_astar_planner.instructions.clauses.clause import Clause
from llm_astar_planner.instructions.interpretation import (
    Interpretation,
    Interpreter,
    RouteInstruction,
    Understanding,
)
from llm_astar_planner.instructions.outcome import ClauseStatus
from llm_astar_planner.instructions.polygons import NoRegionError
from llm_astar_planner.instructions.region_finder import RegionFinder
from llm_astar_planner.instructions.route import Route
from llm_astar_planner.instructions.specification import Specification
from llm_astar_planner.instructions.text import REQUIRE
from llm_astar_planner.instructions.verification.verify import verify
from llm_astar_planner.planning.planner import Planner
from llm_astar_planner.planning.types import Plan, PlanRequest, finite_or_none
from llm_astar_planner.search.arrays import StopFlag
from llm_astar_planner.search.methods import EXACT

# What a question asks; the file with the words has these names too.
INSTEAD, OPENED, LENGTH = 'instead', 'opened', 'length'
# Metres; what costs less is not worth a word.
LEAST_PRICE = 0.05
# Metres; a path that is longer by less is as short.
LEAST_LENGTH = 0.005
# Seconds to read a region.
READING_S = 5.0
# Seconds that each search may take at least, and zones of which the price is searched for.
SEARCH_S, MOST_PRICED = 10.0, 20
# How far obstacles may lie to both sides of a gap: metres, but so many cells at least and at most;
# and cells before and after a place that tell which way a path leads there.
GAP, GAP_CELLS, AHEAD = 1.5, (5, 30), 3
END = ' \t\n?!.¿¡"\'«»„“”'


class QuestionError(LlmAstarError, ValueError):
    """A question that is not understood, or about what is not there; says what can be asked."""


class Asked(NamedTuple):
    """A question: its kind, what the grammar is to read, and the words and the language."""

    kind: str
    text: str
    words: str
    language: str


# The questions and answers of each language.
LANGUAGES: dict[str, dict[str, Any]] = read_yaml(
    Path(__file__).with_name('questions.yaml'), QuestionError
)


def read_question(text: str) -> Asked | None:
    """Return what a text asks, None where it is no question about a path."""
    words = text.strip(END)
    for language, table in LANGUAGES.items():
        for pattern, kind, read in table['questions']:
            found = re.fullmatch(pattern, words, re.IGNORECASE)
            if found is not None:
                named = found[1] if found.groups() else ''
                # What "why not" is followed by is a name of its own.
                return Asked(kind, read.format(named), named if read == '{}' else words, language)
    return None


class Questions:
    """Answers questions about one request on one map; each answer takes some searches."""

    def __init__(
        self,
        planner: Planner,
        request: PlanRequest,
        interpreter: Interpreter,
        places: Places = NO_PLACES,
        stop: StopFlag | None = None,
    ) -> None:
        """Take the request; instructions are kept strictly here, and every search is exact.

        `stop` ends the searches as it ends a plan.
        """
        self.planner, self.places, self.interpreter = planner, places, interpreter
        self.stop = stop
        # The path that the last question asked about.
        self.other: Plan | None = None
        self.request = replace(
            request, method=EXACT, source=None, viapoints=(), any_angle=False,
            want_expanded=False, allow_partial_planning=False, alternatives=0,
            time_limit=max(request.time_limit, SEARCH_S),
        )  # fmt: skip
        self.before = request.instruction or RouteInstruction(Interpretation(''), places)
        self.said = self.before.interpretation.specification.clauses

    def answer(self, text: str) -> dict[str, Any]:
        """Answer a question. Raises QuestionError.

        Return the `sentence`, the length of the best path in metres, `own`, and that of the
        `other` one that was asked about or `prices`, the lengths without single causes; None
        where there is no path.
        """
        asked = read_question(text)
        if asked is None:
            raise QuestionError(
                f'{text[:80]!r} is not understood; ask "why not through PLACE?", "why so long?" '
                'or "what if PLACE were open?"'
            )
        words, is_opened = LANGUAGES[asked.language], asked.kind == OPENED
        own = self.plan(any_angle=asked.kind == LENGTH)
        if asked.kind == LENGTH:
            return self.length(own, words)
        clauses = () if is_opened else self.clauses(asked)
        other = self.opened(asked) if is_opened else self.under(self.said + clauses)
        self.other = None if other.code else other
        template = 'impossible' if other.code else 'possible' if own.code else 'compared'
        if template == 'compared' and self.metres(other) - self.metres(own) < LEAST_LENGTH:
            template = 'compared' if is_opened else 'same'
        if asked.text == asked.words and self.keeps(own, clauses):
            template = 'already'
        sentence = words[template].format(
            asked=asked.words, own=self.metres(own), other=self.metres(other),
            message=other.message,
        )  # fmt: skip
        gap = None if other.code or template == 'already' else self.narrowest(other)
        if gap is not None:
            (x, y), spare = gap
            sentence += words['narrow'].format(x=x, y=y, spare=spare)
        lengths = {'own': self.metres(own), 'other': self.metres(other)}
        return {'sentence': sentence, **{k: finite_or_none(m) for k, m in lengths.items()}}

    def plan(self, planner: Planner | None = None, **changes: Any) -> Plan:  # noqa: ANN401
        """Plan the request with changes, on another map if its planner is given."""
        return (planner or self.planner).plan(replace(self.request, **changes), self.stop)

    def keeps(self, plan: Plan, clauses: tuple[Clause, ...]) -> bool:
        """Tell whether the path of a plan keeps clauses as it is."""
        if plan.code:
            return False
        path = self.planner.grid_map.grid_to_world(plan.path)
        route = Route(self.planner.costmap, plan.start, plan.goal, self.places)
        outcomes = verify(Specification(clauses), path, route)
        return all(outcome.status is ClauseStatus.KEPT for outcome in outcomes)

    def clauses(self, asked: Asked) -> tuple[Clause, ...]:
        """Return what the grammar reads. Raises QuestionError."""
        reading = self.interpreter.interpret(asked.text, self.places, READING_S)
        if not reading.is_whole or not reading.specification.clauses:
            raise QuestionError(f'{asked.words[:80]!r} is not understood: {reading.summary()}')
        return reading.specification.clauses

    def under(self, clauses: tuple[Clause, ...]) -> Plan:
        """Return the best path under some clauses alone."""
        reading = Interpretation(
            'asked', Specification(clauses), 'grammar', Understanding.WHOLE
        ).confirmed()
        strict = replace(self.before, interpretation=reading, policy=REQUIRE, want_prices=False)
        return self.plan(instruction=strict if clauses else None)

    def opened(self, asked: Asked) -> Plan:
        """Return the best path if a zone were not there or a region free. Raises QuestionError."""
        grid_map, said = self.planner.grid_map, asked.words.casefold()
        for label, without in self.without_zones():
            # The label is the id and the name.
            if any(name in said for name in label.casefold().strip(')').split(' (')):
                return self.plan(Planner(without, self.planner.config))
        route = Route(self.planner.costmap, self.request.start, self.request.goal, self.places)
        cells = grid_map.cells.copy()
        for clause in self.clauses(asked):
            if isinstance(clause, Avoid):
                with raising(QuestionError, '', NoRegionError):
                    cells[RegionFinder(route).avoided(clause.region).touched] = FREE
        return self.plan(Planner(replace(grid_map, cells=cells), self.planner.config))

    def length(self, own: Plan, words: dict[str, Any]) -> dict[str, Any]:
        """Say what makes the best path longer than a straight line."""
        metres, resolution = self.metres(own), self.planner.grid_map.resolution
        straight = math.dist(self.request.start, self.request.goal) * resolution
        most = math.inf if own.code else metres - LEAST_PRICE
        found = [(name, self.metres(plan)) for name, plan in self.cheaper(words)]
        prices = [one for one in found if one[1] < most]
        prices.sort(key=lambda price: price[1])
        said = [words['price'].format(name=name, other=other) for name, other in prices]
        shortest = metres
        if own.any_angle is not None and own.any_angle.length * resolution < most:
            shortest = own.any_angle.length * resolution
            said.append(words['angles'].format(own=metres, other=shortest))
        if not (prices or shortest - straight < LEAST_PRICE):
            said.append(words['nothing'])
        template = words['impossible'] if own.code else words['length']
        sentence = template.format(asked='', own=metres, straight=straight, message=own.message)
        sentence = sentence.lstrip(': ') + ''.join(said)
        return {'sentence': sentence, 'own': finite_or_none(metres), 'prices': dict(prices)}

    def cheaper(self, words: dict[str, Any]) -> Iterator[tuple[str, Plan]]:
        """Yield each cause that may be left out, with the plan without it."""
        grid_map, config = self.planner.grid_map, self.planner.config
        for label, without in islice(self.without_zones(), MOST_PRICED):
            yield label, self.plan(Planner(without, config))
        if config.robot_radius:
            point = replace(config, robot_radius=0.0)
            yield words['radius'], self.plan(Planner(grid_map, point))
        if not config.allow_unknown:
            known = replace(config, allow_unknown=True)
            yield words['unknown'], self.plan(Planner(grid_map, known))
        for clause in self.said:
            fewer = tuple(other for other in self.said if other is not clause)
            yield f'"{clause.sentence()}"', self.under(fewer)

    def without_zones(self) -> Iterator[tuple[str, GridMap]]:
        """Yield the label of each zone, with the map without it."""
        composed = self.planner.grid_map.composed
        return iter(()) if composed is None else composed.without_each()

    def metres(self, plan: Plan) -> float:
        """Return the length of a plan's path, NaN without one."""
        return round(plan.length * self.planner.grid_map.resolution, 3)

    def narrowest(self, plan: Plan) -> tuple[tuple[float, float], float] | None:
        """Return the narrowest gap between obstacles on both sides that a path passes.

        That is (x, y) in metres, and how many of them the robot has to spare on its nearer side;
        None where it passes no gap.
        """
        planner, path, resolution = self.planner, plan.path, self.planner.grid_map.resolution
        reach = min(max(math.ceil(GAP / resolution), GAP_CELLS[0]), GAP_CELLS[1])
        lethal = np.pad(planner.grid_map.cells >= planner.config.occupied_threshold, reach)
        places = np.arange(len(path))
        last = len(path) - 1
        ahead = path[np.minimum(places + AHEAD, last)] - path[np.maximum(places - AHEAD, 0)]
        sides = np.full((2, len(path)), np.inf)
        around = np.argwhere(np.ones((2 * reach + 1, 2 * reach + 1))) - reach
        # The nearest last, which then counts. What lies ahead is beside the path nowhere.
        for x, y in around[np.argsort(-np.hypot(*around.T), kind='stable')]:
            across = ahead[:, 0] * y - ahead[:, 1] * x
            is_beside = abs(across) >= abs(ahead[:, 0] * x + ahead[:, 1] * y)
            is_hit = is_beside & lethal[path[:, 1] + y + reach, path[:, 0] + x + reach]
            sides[0, is_hit & (across > 0)] = sides[1, is_hit & (across < 0)] = math.hypot(x, y)
        place = int(sides.sum(axis=0).argmin())
        if not np.isfinite(sides[:, place]).all():
            return None
        x, y = planner.grid_map.grid_to_world([path[place]])[0].round(2).tolist()
        return (x, y), float(sides[:, place].min()) * resolution - planner.config.robot_radius
