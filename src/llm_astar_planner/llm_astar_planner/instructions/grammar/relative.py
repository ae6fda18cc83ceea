"""Places told by where they lie: 'the room in the top left', 'the vertical wall'."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import pairwise

from llm_astar_msgs_adapter.maps.places import Place

NORTH, SOUTH, EAST, WEST = 'north', 'south', 'east', 'west'
OPPOSITE = {NORTH: SOUTH, SOUTH: NORTH, EAST: WEST, WEST: EAST, 'left': 'right', 'right': 'left'}
# How much farther to the wanted side the meant place must lie than any other, as a share of the
# extent of all that could be meant.
CLEARLY = 0.08
# Metres. Places that differ by less lie side by side.
LEAST_SPAN = 0.25
# Places lie in a row that is so many times longer than wide, as a share.
ROW = 0.2
# A wall is vertical or horizontal if it is so many times longer than wide.
ELONGATED = 1.5


def towards(place: Place, side: str) -> float:
    """Return how far to a compass side the middle of a place lies, metres."""
    centre = place.geometry.centroid
    along = float(centre.y if side in (NORTH, SOUTH) else centre.x)
    return along if side in (NORTH, EAST) else -along


def extreme(places: Sequence[Place], sides: Sequence[str]) -> tuple[Place, ...]:
    """Return the one place that lies farthest to all the sides, or those that may be meant.

    For a corner, ('north', 'west'), the distances are in shares of the extent.
    """
    spans = {side: span(places, side) for side in sides}
    sides = [side for side in sides if spans[side] > LEAST_SPAN]
    if not sides:
        return tuple(places)

    def score(place: Place) -> float:
        return sum(towards(place, side) / spans[side] for side in sides)

    best = clearly_first(places, score)
    if len(best) == 1 and not all(is_beyond_the_middle(best[0], places, side) for side in sides):
        return tuple(places)
    return best


def span(places: Sequence[Place], side: str) -> float:
    """Return the extent of the places' middles along an axis, metres."""
    values = [towards(place, side) for place in places]
    return max(values, default=0.0) - min(values, default=0.0)


def is_beyond_the_middle(place: Place, places: Sequence[Place], side: str) -> bool:
    """Whether a place lies in the half of all of them that is on a side."""
    values = [towards(other, side) for other in places]
    return towards(place, side) > (max(values) + min(values)) / 2


def clearly_first(places: Sequence[Place], score: Callable[[Place], float]) -> tuple[Place, ...]:
    """Return the place of the highest score, with all others that are nearly as high."""
    most = max((score(place) for place in places), default=0.0)
    return tuple(place for place in places if score(place) >= most - CLEARLY)


def central(places: Sequence[Place]) -> tuple[Place, ...]:
    """Return the place in the middle of all, or those that may be meant."""
    spans = {side: span(places, side) for side in (NORTH, EAST)}
    # Of places in a row the middle one has as many on one side as on the other.
    least = max(LEAST_SPAN, ROW * max(spans.values()))
    sides = [side for side in spans if spans[side] > least]
    if len(sides) == 1 and len(places) > 2:
        return (
            counted(places, len(places) // 2 + 1, sides[0]) if len(places) % 2 else tuple(places)
        )
    if len(places) < 3 or not sides:
        return tuple(places)
    middles = {side: sum(extremes(places, side)) / 2 for side in sides}

    def nearness(place: Place) -> float:
        return -max(
            abs(towards(place, side) - middles[side]) / span(places, side) for side in sides
        )

    return clearly_first(places, nearness)


def extremes(places: Sequence[Place], side: str) -> tuple[float, float]:
    """Return the least and the most of the places' middles along an axis."""
    values = [towards(place, side) for place in places]
    return min(values), max(values)


def counted(places: Sequence[Place], number: int, side: str) -> tuple[Place, ...]:
    """Return the place of a number, counted from a side: 'the second aisle from the south'.

    Where two lie about equally far, nobody can count: all are returned.
    """
    ordered = sorted(places, key=lambda place: -towards(place, side))
    least = CLEARLY * span(places, side)
    gaps = [towards(a, side) - towards(b, side) for a, b in pairwise(ordered)]
    if number > len(ordered) or any(gap <= least for gap in gaps):
        return tuple(places)
    return (ordered[number - 1],)


def is_oriented(place: Place, orientation: str) -> bool:
    """Whether a place is long in the direction 'vertical' (along y) or 'horizontal'."""
    x0, y0, x1, y1 = place.geometry.bounds
    width, height = x1 - x0, y1 - y0
    if orientation == 'vertical':
        return bool(height >= ELONGATED * width and height > 0.0)
    return bool(width >= ELONGATED * height and width > 0.0)
