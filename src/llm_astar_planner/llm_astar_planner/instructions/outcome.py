"""What became of an instruction on a path, clause by clause."""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import Enum
from typing import Any

from llm_astar_planner.instructions.clauses.clause import Clause
from llm_astar_planner.instructions.interpretation import Interpretation, Understanding


class ClauseStatus(Enum):
    """What became of one clause."""

    KEPT = 'kept'
    # A wish, or a demand that no path keeps: by the least that any path can.
    AS_FAR_AS_POSSIBLE = 'kept as far as possible'
    NOT_KEPT = 'not kept'
    # No path on this map satisfies it, whatever the other clauses are.
    IMPOSSIBLE = 'impossible'
    NOT_UNDERSTOOD = 'not understood'
    # It was read, but not for certain: enforced, but nothing is claimed till it is confirmed.
    UNSURE = 'unsure'
    # Understood, but nothing that a path has: a speed, a time.
    UNSUPPORTED = 'unsupported'


@dataclass(frozen=True)
class ClauseOutcome:
    """What became of one clause, as measured on the path.

    - `measured`, `least`: metres that the path violates the clause by (inside a region, outside
      of one, short of a distance, or off a region to visit), and the least that any path can;
      NaN where nothing was measured.
    - `where`: the point (x, y) in metres where the path violates it first or most, or None.
    - `detail`: the measured fact as a short sentence.
    - `price`: the metres by which the path is longer for this clause, NaN where not measured.
    """

    clause: Clause
    status: ClauseStatus
    detail: str = ''
    measured: float = math.nan
    least: float = math.nan
    where: tuple[float, float] | None = None
    price: float = math.nan

    def to_json(self) -> dict[str, Any]:
        """Return the form of reports and `--json`; NaN is null."""
        return {
            'clause': self.clause.sentence(),
            'kind': self.clause.kind,
            'status': self.status.value,
            'detail': self.detail,
            'measured': self.measured if math.isfinite(self.measured) else None,
            'least': self.least if math.isfinite(self.least) else None,
            'where': None if self.where is None else list(self.where),
            'price': self.price if math.isfinite(self.price) else None,
        }


@dataclass(frozen=True)
class InstructionOutcome:
    """What became of an instruction: what was understood, and each clause on the final path.

    `note` says what concerns the whole: contradictions, no path, not understood yet.
    """

    interpretation: Interpretation
    clauses: tuple[ClauseOutcome, ...] = ()
    note: str = ''

    @property
    def satisfied(self) -> bool | None:
        """True if all was understood and every clause is satisfied; None if nothing was asked."""
        if self.interpretation.status is Understanding.IRRELEVANT:
            return None
        understood = self.interpretation.status is Understanding.WHOLE
        done = all(outcome.status is ClauseStatus.KEPT for outcome in self.clauses)
        return understood and bool(self.clauses) and done

    def summary(self) -> str:
        """Return one line for the report: the status of each clause with the measured fact."""
        status = self.interpretation.status
        parts = [
            f'{outcome.clause.sentence()}: {outcome.status.value}'
            + (f' ({outcome.detail})' if outcome.detail else '')
            for outcome in self.clauses
        ]
        if not parts:
            parts = [status.value]
            if self.interpretation.detail:
                parts[0] += f': {self.interpretation.detail}'
        if self.note:
            parts.append(self.note)
        return '; '.join(parts)

    def to_json(self) -> dict[str, Any]:
        """Return the form of reports and `--json`."""
        return {
            'summary': self.summary(),
            'satisfied': self.satisfied,
            'clauses': [outcome.to_json() for outcome in self.clauses],
            'note': self.note,
            'interpretation': self.interpretation.to_json(),
        }
