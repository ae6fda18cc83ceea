# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""The route specification: what an instruction asks of a path, as clauses, with its JSON form.

Lengths are metres and points lie in the map's frame. The JSON form is published in
`route_spec.schema.json`.
"""

from dataclasses import dataclass
from importlib import import_module
from itertools import groupby
from pkgutil import iter_modules
from typing import Any

from llm_astar_msgs_adapter.errors import short_repr

from llm_astar_planner.instructions import clauses, fields
from llm_astar_planner.instructions.clauses.clause import MUST, STRENGTHS, Clause
from llm_astar_planner.instructions.clauses.unknown import Unknown
from llm_astar_planner.instructions.clauses.visit import Visit

# That of the JSON form; 1, without a number, knows fewer kinds and `guessed` clauses.
VERSION = 2
MAX_CLAUSES = 16
# Regions to visit, all clauses together.
MAX_VISITS = 8
GUESSED = 'it has a number or a name that the sentence does not hold'


def all_kinds() -> dict[str, type[Clause]]:
    """Return the classes of clauses by kind: those in the modules of `clauses`."""
    found = {}
    for module in iter_modules(clauses.__path__, f'{clauses.__name__}.'):
        for value in vars(import_module(module.name)).values():
            if isinstance(value, type) and issubclass(value, Clause) and value.kind:
                found[value.kind] = value
    return found


CLAUSES = all_kinds()


@dataclass(frozen=True)
class Specification:
    """What an instruction asks: clauses, in the order of the sentence.

    Raises SpecificationError over more than MAX_CLAUSES clauses or MAX_VISITS regions to visit.
    """

    clauses: tuple[Clause, ...] = ()

    def __post_init__(self) -> None:
        """Check the sizes."""
        if len(self.clauses) > MAX_CLAUSES:
            raise fields.SpecificationError(
                f'{len(self.clauses)} clauses, over the {MAX_CLAUSES} allowed'
            )
        visits = sum(len(clause.regions) for clause in self.clauses if isinstance(clause, Visit))
        if visits > MAX_VISITS:
            raise fields.SpecificationError(f'{visits} regions to visit are over {MAX_VISITS}')

    @property
    def enforceable(self) -> tuple[Clause, ...]:
        """The clauses that ask something of a path."""
        return tuple(clause for clause in self.clauses if not isinstance(clause, Unknown))

    @property
    def sentence(self) -> str:
        """The canonical English sentence, '' without clauses: 'avoid the kitchen; ...'.

        Every part is read back by the grammar as the same clause, so it says all there is.
        Successive visits of the same strength are joined by 'then'.
        """
        parts = []
        runs = groupby(
            enumerate(self.clauses),
            lambda item: item[1].strength if isinstance(item[1], Visit) else item[0],
        )
        for _, run in runs:
            (_, first), *others = run
            then = [f', then {visit.regions_phrase()}' for _, visit in others]  # type: ignore[attr-defined]
            parts.append(first.sentence() + ''.join(then))
        return '; '.join(parts)

    def to_json(self) -> dict[str, Any]:
        """Return the JSON form."""
        return {
            'version': VERSION,
            'clauses': [clause_to_json(clause) for clause in self.clauses],
        }


NOTHING_ASKED = Specification()


def clause_to_json(clause: Clause) -> dict[str, Any]:
    """Return the JSON form of a clause."""
    own = {'kind': clause.kind, **clause.to_json()}
    if isinstance(clause, Unknown):
        return own
    unsure = {'unsure': clause.unsure, 'guessed': True} if clause.unsure else {}
    return {**own, 'strength': clause.strength, **unsure}


def from_json(value: object) -> Specification:
    """Read a specification. Raises SpecificationError, which names the clause and the field."""
    values = fields.as_mapping(value, 'specification')
    version, found = values.get('version', 1), values.get('clauses')
    if version not in range(1, VERSION + 1):
        raise fields.SpecificationError(f'version: {short_repr(version)} is not 1 to {VERSION}')
    if not isinstance(found, list):
        raise fields.SpecificationError('clauses: is not a list')
    return Specification(
        tuple(clause_from_json(item, f'clause {n}') for n, item in enumerate(found, start=1))
    )


def clause_from_json(value: object, where: str) -> Clause:
    """Read a clause; `where` names it in errors. Raises SpecificationError."""
    values = fields.as_mapping(value, where)
    kind = 'visit' if values.get('kind') == 'via' else values.get('kind')
    made = CLAUSES[fields.as_choice(kind, f'{where}: kind', CLAUSES)]
    where = f'{where} ({kind})'
    own = made.read(values, where)
    if issubclass(made, Unknown):
        return made(**own)
    strength = fields.as_choice(values.get('strength', MUST), f'{where}: strength', STRENGTHS)
    asked = values.get('unsure') or (GUESSED if values.get('guessed') else '')
    unsure = fields.as_text(asked, f'{where}: unsure', fields.MAX_QUESTION_CHARS) if asked else ''
    return made(strength, unsure, **own)
