"""The canonical English sentence of a specification: what the operator and the report show.

Every part is read back by the grammar as the same clause, so a sentence says all there is.
"""

from __future__ import annotations

import math

from llm_astar_planner.instructions import specification as spec

SIDE_NAMES = ('west', 'south', 'east', 'north')


def canonical_sentence(specification: spec.Specification) -> str:
    """Return the sentence of a specification, '' without clauses: 'avoid the kitchen; ...'.

    Successive visits of the same strength are joined by 'then'.
    """
    parts: list[str] = []
    last: spec.Clause | None = None
    for clause in specification.clauses:
        follows = isinstance(last, spec.Visit) and last.strength == clause.strength
        if isinstance(clause, spec.Visit) and follows:
            parts[-1] += f', then {regions_phrase(clause)}'
        else:
            parts.append(clause_sentence(clause))
        last = clause
    return '; '.join(parts)


def clause_sentence(clause: spec.Clause) -> str:
    """Return the sentence of a clause, without its grounding."""
    condition = 'if possible, ' if clause.strength == spec.SHOULD else ''
    return condition + clause_phrase(clause)


def clause_phrase(clause: spec.Clause) -> str:
    """Return what a clause asks for, without its strength."""
    match clause:
        case spec.Avoid(region=region, margin=margin):
            if margin:
                return f'avoid {distant_phrase(region)} by {metres(margin)}'
            return f'avoid {region_phrase(region)}'
        case spec.Visit():
            return f'visit {regions_phrase(clause)}'
        case spec.Before(first=first, second=second):
            return f'do not enter {region_phrase(second, any_one=True)} before ' + region_phrase(
                first, any_one=True
            )
        case spec.StayIn(region=region):
            return f'stay in {region_phrase(region)}'
        case spec.Pass(region=region, side=side):
            where = f'{side} of the direct way' if side in spec.ROUTE_SIDES else f'{side} side'
            # 'all blue places on the north side' would be those that lie there, walls likewise.
            how = 'by' if isinstance(region, (spec.Tagged, spec.Along)) else 'on'
            return f'pass {region_phrase(region)} {how} the {where}'
        case spec.KeepDistance(metres=distance, region=None):
            return f'keep {metres(distance)} away from the walls'
        case spec.KeepDistance(metres=distance, region=spec.Region() as region):
            return f'keep {metres(distance)} away from {distant_phrase(region)}'
        case spec.EndAt(region=region):
            return f'end in {region_phrase(region, any_one=True)}'
        case spec.Unknown(text=text):
            return f'not understood: "{text}"'
    raise TypeError(type(clause).__name__)


def regions_phrase(visit: spec.Visit) -> str:
    """Return the regions of a visit: 'the lab and the kitchen in any order'."""
    phrases = [region_phrase(region, any_one=True) for region in visit.regions]
    if len(phrases) == 1:
        return phrases[0]
    return f'{", ".join(phrases[:-1])} and {phrases[-1]} in any order'


def distant_phrase(region: spec.Region) -> str:
    """Return the words for a region that a distance is measured from.

    'avoid the point 1, 2 by 3 m' is a disc of 3 m around the point, not a margin around a disc.
    """
    if isinstance(region, spec.Disc) and not region.radius:
        return f'the surroundings of {region_phrase(region)}'
    return region_phrase(region)


def region_phrase(region: spec.Region, any_one: bool = False) -> str:
    """Return the words for a region; with `any_one`, one of the places of a tag is meant."""
    match region:
        case spec.NamedPlace(name):
            return f'the {name}'
        case spec.Tagged(tag):
            return f'one of the {tag} places' if any_one else f'all {tag} places'
        case spec.Disc(x, y, radius):
            within = f'the {metres(radius)} around ' if radius else ''
            return f'{within}the point {number(x)}, {number(y)}'
        case spec.Box():
            return box_phrase(region)
        case spec.Half(side, of):
            if of:
                return f'the {side} half of the {of}'
            of_way = ' of the direct way' if side in spec.ROUTE_SIDES else ''
            return f'the {side} {"side" if of_way else "half"}{of_way}'
        case spec.Between(first, second):
            return f'the gap between the {first} and the {second}'
        case spec.Along(place, width):
            name = 'the walls' if place == spec.WALLS else f'the {place}'
            return f'the {metres(width)} along {name}'
    raise TypeError(type(region).__name__)


def box_phrase(box: spec.Box) -> str:
    """Return the words for a box: 'the area with x from 2 to 5 and y above 3'."""
    ranges = []
    for axis, low, high in (('x', box.x0, box.x1), ('y', box.y0, box.y1)):
        if math.isfinite(low) and math.isfinite(high):
            ranges.append(f'{axis} from {number(low)} to {number(high)}')
        elif math.isfinite(low):
            ranges.append(f'{axis} above {number(low)}')
        elif math.isfinite(high):
            ranges.append(f'{axis} below {number(high)}')
    return f'the area with {" and ".join(ranges)}' if ranges else 'the whole map'


def metres(length: float) -> str:
    """Return a length in words: '3 m'."""
    return f'{number(length)} m'


def number(value: float) -> str:
    """Return a number to the millimetre, without an exponent and trailing zeros."""
    text = f'{value:.3f}'.rstrip('0').rstrip('.')
    return '0' if text == '-0' else text
