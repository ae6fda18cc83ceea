"""The JSON form of specifications, published in `route_spec.schema.json`: written and read."""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Mapping
from typing import Any

from llm_astar_msgs_adapter.errors import short_repr

from llm_astar_planner.instructions import specification as spec

# Metres. No map is farther away than this.
FAR = 1e6
Fields = Mapping[str, Any]


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
        case spec.Visit(regions=regions):
            fields['regions'] = [region_to_json(region) for region in regions]
        case spec.Before(first=first, second=second):
            fields |= {'first': region_to_json(first), 'second': region_to_json(second)}
        case spec.KeepDistance(metres=metres, region=other):
            fields['from'] = spec.WALLS if other is None else region_to_json(other)
            fields['metres'] = metres
        case _:
            fields['region'] = region_to_json(spec.regions_of(clause)[0])
    if isinstance(clause, spec.Avoid) and clause.margin:
        fields['margin'] = clause.margin
    if isinstance(clause, spec.Pass):
        fields['side'] = clause.side
    fields['strength'] = clause.strength
    return fields | ({'guessed': True} if clause.guessed else {})


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
    own = {name: read(fields, where) for name, read in READERS[kind].items()}
    return spec.CLAUSES[kind](strength, guessed, **own)


def field_region(name: str, other: str = '') -> Callable[[Fields, str], spec.Region]:
    """Return what reads the region in a field, which may also be called `other`."""
    return lambda fields, where: region_from_json(
        fields.get(name, fields.get(other)), f'{where}: {name}'
    )


def margin(fields: Fields, where: str) -> float:
    """Read the margin of an avoided region."""
    return as_number(fields.get('margin', 0.0), f'{where}: margin', 0.0, spec.MAX_METRES)


def visited(fields: Fields, where: str) -> tuple[spec.Region, ...]:
    """Read the regions of a visit, or the only one."""
    regions = fields.get('regions', [fields.get('region')])
    if not isinstance(regions, list) or not regions:
        raise spec.SpecificationError(f'{where}: regions: is not a list of regions')
    return tuple(region_from_json(item, f'{where}: regions') for item in regions)


def distance(fields: Fields, where: str) -> float:
    """Read a distance to keep."""
    metres = as_number(fields.get('metres'), f'{where}: metres', 0.0, spec.MAX_METRES)
    if metres == 0.0:
        raise spec.SpecificationError(f'{where}: metres: must be above 0')
    return metres


def distant(fields: Fields, where: str) -> spec.Region | None:
    """Read what a distance is kept from, None for the walls."""
    other = fields.get('from')
    return None if other == spec.WALLS else region_from_json(other, f'{where}: from')


# What reads the fields of a clause besides the common ones, by kind; in the order of the errors.
READERS: dict[str, dict[str, Callable[[Fields, str], Any]]] = {
    'avoid': {'margin': margin, 'region': field_region('region')},
    'visit': {'regions': visited},
    'before': {'first': field_region('first'), 'second': field_region('second')},
    'stay_in': {'region': field_region('region')},
    'end_at': {'region': field_region('region')},
    'pass': {
        'side': lambda fields, where: as_choice(fields.get('side'), f'{where}: side', spec.SIDES),
        'region': field_region('region', 'object'),
    },
    'keep_distance': {'metres': distance, 'region': distant},
}


def region_from_json(value: object, where: str) -> spec.Region:
    """Read a region; `where` names it in errors. Raises SpecificationError.

    A text is the name of a place and a list of two numbers a point, as models write them.
    """
    if isinstance(value, str):
        return spec.NamedPlace(as_text(value, where))
    fields = {'point': value} if isinstance(value, list) else as_mapping(value, where)
    form = next((form for form in FORMS if form in fields), None)
    if form is None:
        raise spec.SpecificationError(f'{where}: has none of {", ".join(FORMS)}')
    return FORMS[form](fields, where)


def disc_from_json(fields: Fields, where: str) -> spec.Disc:
    """Read a point with a radius."""
    x, y = as_numbers(fields['point'], f'{where}: point', 2)
    return spec.Disc(
        x, y, as_number(fields.get('radius', 0.0), f'{where}: radius', 0.0, spec.MAX_METRES)
    )


def half_from_json(fields: Fields, where: str) -> spec.Half:
    """Read a half of the map, or of a place."""
    of = as_text(fields['of'], f'{where}: of') if fields.get('of') else ''
    sides = spec.COMPASS if of else spec.SIDES
    return spec.Half(as_choice(fields['half'], f'{where}: half', sides), of)


def between_from_json(fields: Fields, where: str) -> spec.Between:
    """Read the gap between two places."""
    pair = fields['between']
    if not isinstance(pair, list) or len(pair) != 2:
        raise spec.SpecificationError(f'{where}: between: is not a list of two places')
    return spec.Between(*(as_text(name, f'{where}: between') for name in pair))


def along_from_json(fields: Fields, where: str) -> spec.Along:
    """Read a strip along a place or the walls."""
    width = as_number(
        fields.get('width', spec.ALONG_WIDTH), f'{where}: width', 0.0, spec.MAX_METRES
    )
    return spec.Along(as_text(fields['along'], f'{where}: along'), width)


# What reads a region, by the field that gives its form; the first of them that is there decides.
FORMS: dict[str, Callable[[Fields, str], spec.Region]] = {
    'place': lambda fields, where: spec.NamedPlace(as_text(fields['place'], f'{where}: place')),
    'tag': lambda fields, where: spec.Tagged(as_text(fields['tag'], f'{where}: tag')),
    'point': disc_from_json,
    'box': lambda fields, where: box_from_json(fields['box'], f'{where}: box'),
    'half': half_from_json,
    'between': between_from_json,
    'along': along_from_json,
}


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


def as_mapping(value: object, where: str) -> Fields:
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


def as_choice(value: object, where: str, choices: Collection[str]) -> str:
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
