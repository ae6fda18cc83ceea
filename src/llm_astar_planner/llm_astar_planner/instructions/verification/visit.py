# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""visit: the places of the path at which it visits regions, in their turn."""

import math
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass

from llm_astar_planner.instructions.clauses.visit import Visit
from llm_astar_planner.instructions.outcome import ClauseOutcome, as_length, broken, kept
from llm_astar_planner.instructions.verification.geometry import Spans, first_from
from llm_astar_planner.instructions.verification.measurement import Measurement, Point
from llm_astar_planner.instructions.verification.regions import RegionError, Resolved


@dataclass(frozen=True, eq=False)
class Attempt:
    """Whether the drive visits a region of a visit clause, the `clause`th, in its turn.

    `spans` are its visits at any time, `turn` is where on the drive its turn begins, and `place`
    where it is visited then, inf if nowhere.
    """

    clause: int
    region: Resolved
    spans: Spans
    turn: float
    place: float

    @property
    def done(self) -> bool:
        """Whether the region is visited."""
        return self.place < math.inf


def attempts(measurement: Measurement) -> Iterator[list[Attempt]]:
    """Yield the attempts at the regions of each visit clause, clauses in their order.

    Each region counts at the first place where the drive touches it once its turn has come. That
    decides rightly: the turn of a clause begins where the last region of the one before is first
    visited, and no choice of visits lets it begin earlier, because (by induction over the
    clauses) a region's earliest visit after the earliest turn is the earliest of all its visits
    that are allowed, and the regions of one clause do not depend on each other. So if any choice
    of places in order exists, this one does. A region that is never visited holds up nothing.
    Regions that do not exist are left out.
    """
    turn = 0.0
    for index, clause in enumerate(measurement.specification.clauses):
        if isinstance(clause, Visit):
            tried = []
            for wanted in clause.regions:
                with suppress(RegionError):
                    region = measurement.regions.resolve(wanted)
                    spans = region.visited.spans(measurement.drive)
                    tried.append(Attempt(index, region, spans, turn, first_from(spans, turn)))
            yield tried
            turn = max([turn, *(one.place for one in tried if one.done)])


def check(measurement: Measurement, clause: Visit, index: int) -> ClauseOutcome:
    """Judge one visit clause in the order of all of them."""
    for wanted in clause.regions:
        measurement.regions.resolve(wanted)
    tried = next(group for group in attempts(measurement) if group and group[0].clause == index)
    failed = [one for one in tried if not one.done]
    if not failed:
        places = (measurement.place_text(one.place) for one in tried)
        return kept(clause, '; '.join(f'reached at {place}' for place in places))
    reasons = [measurement.unreachable_reason(one.region.visited) for one in failed]
    worst, reason = next(
        ((one, reason) for one, reason in zip(failed, reasons) if reason), (failed[0], '')
    )
    detail, metres, where = miss(measurement, worst)
    return broken(clause, reason or detail, metres, where, impossible=bool(reason))


def miss(measurement: Measurement, attempt: Attempt) -> tuple[str, float, Point]:
    """Say how the drive misses a region: a sentence, by how many metres, and where."""
    rest = measurement.drive.part(attempt.turn)
    metres = attempt.region.visited.distance(rest.shape)
    where = attempt.region.visited.nearest_point(rest.shape)
    if len(attempt.spans):
        early = measurement.place_text(float(attempt.spans[0, 0]))
        return f'reached before its turn, at {early}, and not again', metres, where
    away = attempt.region.area.distance(measurement.drive.shape)
    if away > 0.0:
        return f'never nearer than {as_length(away)}', metres, where
    return f'entered, but {as_length(metres)} short of a visit', metres, where
