"""The canonical English sentence of a specification: what the operator and the report show.

Every part is read back by the grammar as the same clause, so a sentence says all there is.
"""

from __future__ import annotations

import math

from llm_astar_planner.instructions.specification import (
    ROUTE_SIDES,
    SHOULD,
    WALLS,
    Along,
    Avoid,
    Before,
    Between,
    Box,
    Clause,
    Disc,
    EndAt,
    Half,
    KeepDistance,
    NamedPlace,
    Pass,
    Region,
    Specification,
    StayIn,
    Tagged,
    Unknown,
    Visit,
)

SIDE_NAMES = ('west', 'south', 'east', 'north')


def canonical_sentence(specification: Specification) -> str:
    """Return the sentence of a specification, '' without clauses: 'avoid the kitchen; ...'.

    Successive visits of the same strength are joined by 'then'.
    """
    parts: list[str] = []
    last: Clause | None = None
    for clause in specification.clauses:
        follows = isinstance(last, Visit) and last.strength == clause.strength
        if isinstance(clause, Visit) and follows:
            parts[-1] += f', then {regions_phrase(clause)}'
        else:
            parts.append(clause_sentence(clause))
        last = clause
    return '; '.join(parts)


def clause_sentence(clause: Clause) -> str:
    """Return the sentence of a clause, without its grounding."""
    wish = 'if possible, ' if clause.strength == SHOULD else ''
    return wish + clause_phrase(clause)


def clause_phrase(clause: Clause) -> str:
    """Return what a clause asks for, without its strength."""
    match clause:
        case Avoid(region=region, margin=margin):
            distance = f' by {metres(margin)}' if margin else ''
            return f'avoid {region_phrase(region)}{distance}'
        case Visit():
            return f'visit {regions_phrase(clause)}'
        case Before(first=first, second=second):
            return f'visit {region_phrase(first)} before {region_phrase(second)}'
        case StayIn(region=region):
            return f'stay in {region_phrase(region)}'
        case Pass(region=region, side=side):
            on = f'{side} of the direct way' if side in ROUTE_SIDES else f'{side} side'
            return f'pass {region_phrase(region)} on the {on}'
        case KeepDistance(metres=distance, region=None):
            return f'keep {metres(distance)} away from the walls'
        case KeepDistance(metres=distance, region=Region() as region):
            return f'keep {metres(distance)} away from {region_phrase(region)}'
        case EndAt(region=region):
            return f'end in {region_phrase(region)}'
        case Unknown(text=text):
            return f'not understood: "{text}"'
    raise TypeError(type(clause).__name__)


def regions_phrase(visit: Visit) -> str:
    """Return the regions of a visit: 'the lab and the kitchen in any order'."""
    phrases = [region_phrase(region) for region in visit.regions]
    if len(phrases) == 1:
        return phrases[0]
    return f'{", ".join(phrases[:-1])} and {phrases[-1]} in any order'


def region_phrase(region: Region) -> str:
    """Return the words for a region."""
    match region:
        case NamedPlace(name):
            return f'the {name}'
        case Tagged(tag):
            return f'all {tag} places'
        case Disc(x, y, radius):
            within = f'the {metres(radius)} around ' if radius else ''
            return f'{within}the point {x:g}, {y:g}'
        case Box():
            return box_phrase(region)
        case Half(side, of):
            if of:
                return f'the {side} half of the {of}'
            of_way = ' of the direct way' if side in ROUTE_SIDES else ''
            return f'the {side} {"side" if of_way else "half"}{of_way}'
        case Between(first, second):
            return f'the gap between the {first} and the {second}'
        case Along(place, width):
            name = 'the walls' if place == WALLS else f'the {place}'
            return f'the {metres(width)} along {name}'
    raise TypeError(type(region).__name__)


def box_phrase(box: Box) -> str:
    """Return the words for a box: 'the area with x from 2 to 5 and y above 3'."""
    ranges = []
    for axis, low, high in (('x', box.x0, box.x1), ('y', box.y0, box.y1)):
        if math.isfinite(low) and math.isfinite(high):
            ranges.append(f'{axis} from {low:g} to {high:g}')
        elif math.isfinite(low):
            ranges.append(f'{axis} above {low:g}')
        elif math.isfinite(high):
            ranges.append(f'{axis} below {high:g}')
    return f'the area with {" and ".join(ranges)}' if ranges else 'the whole map'


def metres(length: float) -> str:
    """Return a length in words: '3 m'."""
    return f'{length:g} m'
