"""The JSON form of specifications: writing, reading with checks, and the published schema."""

from __future__ import annotations

import copy
import json
import math
from collections.abc import Mapping, Sequence
from functools import cache
from pathlib import Path
from typing import Any

from llm_astar_msgs_adapter.errors import short_repr

from llm_astar_planner.instructions import specification as spec

SCHEMA_FILE = Path(__file__).with_name('route_spec.schema.json')
# Metres. No map is farther away than this.
FAR = 1e6


@cache
def schema() -> dict[str, Any]:
    """Return the published JSON Schema of a specification; do not change it."""
    loaded: dict[str, Any] = json.loads(SCHEMA_FILE.read_text(encoding='utf-8'))
    return loaded


def schema_for(names: Sequence[str], tags: Sequence[str] = ()) -> dict[str, Any]:
    """Return the schema with the names and tags of a map's places as enumerations.

    A decoder that is constrained by it cannot invent a place. Without names, the forms that need
    one are left with an empty choice.
    """
    made = copy.deepcopy(schema())
    made['$defs']['name'] = {'enum': list(names)}
    made['$defs']['tag'] = {'enum': list(tags)}
    return made


def to_json(specification: spec.Specification) -> dict[str, Any]:
    """Return the JSON form of a specification."""
    return {'clauses': [clause_to_json(clause) for clause in specification.clauses]}


def region_to_json(region: spec.Region) -> dict[str, Any]:
    """Return the JSON form of a region."""
    match region:
        case spec.NamedPlace(name):
            return {'place': name}
        case spec.Tagged(tag):
            return {'tag': tag}
        case spec.Disc(x, y, radius):
            return {'point': [x, y], 'radius': radius} if radius else {'point': [x, y]}
        case spec.Box(x0, y0, x1, y1):
            sides = (x0, y0, x1, y1)
            return {'box': [side if math.isfinite(side) else None for side in sides]}
        case spec.Half(side, of):
            return {'half': side, 'of': of} if of else {'half': side}
        case spec.Between(first, second):
            return {'between': [first, second]}
        case spec.Along(place, width):
            return {'along': place, 'width': width}
    raise TypeError(type(region).__name__)


def clause_to_json(clause: spec.Clause) -> dict[str, Any]:
    """Return the JSON form of a clause."""
    fields: dict[str, Any] = {'kind': clause.kind}
    match clause:
        case spec.Unknown(text=text):
            return {**fields, 'text': text}
        case spec.Avoid(region=region, margin=margin):
            fields['region'] = region_to_json(region)
            if margin:
                fields['margin'] = margin
        case spec.Visit(regions=regions):
            fields['regions'] = [region_to_json(region) for region in regions]
        case spec.Before(first=first, second=second):
            fields |= {'first': region_to_json(first), 'second': region_to_json(second)}
        case spec.StayIn(region=region) | spec.EndAt(region=region):
            fields['region'] = region_to_json(region)
        case spec.Pass(region=region, side=side):
            fields |= {'region': region_to_json(region), 'side': side}
        case spec.KeepDistance(metres=metres, region=other):
            fields |= {'from': spec.WALLS if other is None else region_to_json(other)}
            fields['metres'] = metres
    fields['strength'] = clause.strength
    if clause.guessed:
        fields['guessed'] = True
    return fields


def from_json(value: object) -> spec.Specification:
    """Read a specification. Raises SpecificationError, which names the clause and the field."""
    clauses = as_mapping(value, 'specification').get('clauses')
    if not isinstance(clauses, list):
        raise spec.SpecificationError('clauses: is not a list')
    return spec.Specification(
        tuple(clause_from_json(item, f'clause {n}') for n, item in enumerate(clauses, start=1))
    )


def clause_from_json(value: object, where: str) -> spec.Clause:
    """Read a clause; `where` names it in errors. Raises SpecificationError."""
    fields = as_mapping(value, where)
    kind = 'visit' if fields.get('kind') == 'via' else fields.get('kind')
    if not isinstance(kind, str) or kind not in spec.CLAUSES:
        raise spec.SpecificationError(
            f'{where}: kind: {short_repr(kind)} is not one of {", ".join(spec.CLAUSES)}'
        )
    where = f'{where} ({kind})'
    if kind == 'unknown':
        return spec.Unknown(text=as_text(fields.get('text'), f'{where}: text'))
    strength = fields.get('strength', spec.MUST)
    if strength not in spec.STRENGTHS:
        raise spec.SpecificationError(
            f'{where}: strength: {short_repr(strength)} is neither must nor should'
        )
    guessed = fields.get('guessed', False)
    if not isinstance(guessed, bool):
        raise spec.SpecificationError(
            f'{where}: guessed: {short_repr(guessed)} is not true or false'
        )

    def region(name: str) -> spec.Region:
        return region_from_json(fields.get(name), f'{where}: {name}')

    match kind:
        case 'avoid':
            margin = as_number(fields.get('margin', 0.0), f'{where}: margin', 0.0, spec.MAX_METRES)
            return spec.Avoid(strength, guessed, region('region'), margin)
        case 'visit':
            regions = fields.get('regions', [fields.get('region')])
            if not isinstance(regions, list) or not regions:
                raise spec.SpecificationError(f'{where}: regions: is not a list of regions')
            read = tuple(region_from_json(item, f'{where}: regions') for item in regions)
            return spec.Visit(strength, guessed, read)
        case 'before':
            return spec.Before(strength, guessed, region('first'), region('second'))
        case 'stay_in':
            return spec.StayIn(strength, guessed, region('region'))
        case 'end_at':
            return spec.EndAt(strength, guessed, region('region'))
        case 'pass':
            passed = fields.get('region', fields.get('object'))
            side = as_choice(fields.get('side'), f'{where}: side', spec.SIDES)
            return spec.Pass(strength, guessed, region_from_json(passed, f'{where}: region'), side)
    metres = as_number(fields.get('metres'), f'{where}: metres', 0.0, spec.MAX_METRES)
    if metres == 0.0:
        raise spec.SpecificationError(f'{where}: metres: must be above 0')
    other = fields.get('from')
    distant = None if other == spec.WALLS else region_from_json(other, f'{where}: from')
    return spec.KeepDistance(strength, guessed, metres, distant)


def region_from_json(value: object, where: str) -> spec.Region:
    """Read a region; `where` names it in errors. Raises SpecificationError.

    A text is the name of a place and a list of two numbers a point, as models write them.
    """
    if isinstance(value, str):
        return spec.NamedPlace(as_text(value, where))
    if isinstance(value, list):
        value = {'point': value}
    fields = as_mapping(value, where)
    if 'place' in fields:
        return spec.NamedPlace(as_text(fields['place'], f'{where}: place'))
    if 'tag' in fields:
        return spec.Tagged(as_text(fields['tag'], f'{where}: tag'))
    if 'point' in fields:
        x, y = as_numbers(fields['point'], f'{where}: point', 2)
        radius = as_number(fields.get('radius', 0.0), f'{where}: radius', 0.0, spec.MAX_METRES)
        return spec.Disc(x, y, radius)
    if 'box' in fields:
        return box_from_json(fields['box'], f'{where}: box')
    if 'half' in fields:
        of = as_text(fields['of'], f'{where}: of') if fields.get('of') else ''
        return spec.Half(
            as_choice(fields['half'], f'{where}: half', spec.COMPASS if of else spec.SIDES), of
        )
    if 'between' in fields:
        pair = fields['between']
        if not isinstance(pair, list) or len(pair) != 2:
            raise spec.SpecificationError(f'{where}: between: is not a list of two places')
        first, second = (as_text(name, f'{where}: between') for name in pair)
        return spec.Between(first, second)
    if 'along' in fields:
        width = as_number(fields.get('width', 1.0), f'{where}: width', 0.0, spec.MAX_METRES)
        return spec.Along(as_text(fields['along'], f'{where}: along'), width)
    raise spec.SpecificationError(
        f'{where}: has none of place, tag, point, box, half, between, along'
    )


def box_from_json(value: object, where: str) -> spec.Box:
    """Read a box, whose open sides are null. Raises SpecificationError where it is empty."""
    if not isinstance(value, list) or len(value) != 4:
        raise spec.SpecificationError(f'{where}: is not a list of four numbers')
    limits = (-math.inf, -math.inf, math.inf, math.inf)
    x0, y0, x1, y1 = (
        limit if side is None else as_number(side, where, -FAR, FAR)
        for side, limit in zip(value, limits)
    )
    if not (x0 < x1 and y0 < y1):
        raise spec.SpecificationError(
            f'{where}: {short_repr(value)} is empty; give [x0, y0, x1, y1] in order'
        )
    return spec.Box(x0, y0, x1, y1)


def as_mapping(value: object, where: str) -> Mapping[str, Any]:
    """Return a JSON object. Raises SpecificationError otherwise."""
    if not isinstance(value, Mapping):
        raise spec.SpecificationError(f'{where}: is not an object')
    return value


def as_text(value: object, where: str) -> str:
    """Return a text of 1 to MAX_NAME_CHARS characters. Raises SpecificationError otherwise."""
    if not isinstance(value, str) or not 1 <= len(value) <= spec.MAX_NAME_CHARS:
        raise spec.SpecificationError(
            f'{where}: is not a text of 1 to {spec.MAX_NAME_CHARS} characters'
        )
    return value


def as_choice(value: object, where: str, choices: Sequence[str]) -> str:
    """Return one of some texts. Raises SpecificationError otherwise."""
    if not isinstance(value, str) or value not in choices:
        raise spec.SpecificationError(
            f'{where}: {short_repr(value)} is not one of {", ".join(choices)}'
        )
    return value


def as_number(value: object, where: str, least: float, most: float) -> float:
    """Return a number within limits. Raises SpecificationError otherwise."""
    is_number = isinstance(value, (int, float)) and not isinstance(value, bool)
    if not is_number or not least <= value <= most:  # type: ignore[operator]
        raise spec.SpecificationError(
            f'{where}: {short_repr(value)} is not a number from {least:g} to {most:g}'
        )
    return float(value)  # type: ignore[arg-type]


def as_numbers(value: object, where: str, count: int) -> list[float]:
    """Return a list of numbers within FAR. Raises SpecificationError otherwise."""
    if not isinstance(value, list) or len(value) != count:
        raise spec.SpecificationError(f'{where}: is not a list of {count} numbers')
    return [as_number(item, where, -FAR, FAR) for item in value]
