# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""Places told by another one: 'the room next to the kitchen', 'the ward opposite the pharmacy'."""

import re
from collections.abc import Callable, Sequence

from llm_astar_msgs_adapter.maps.places import Place

from llm_astar_planner.instructions.grammar.vocabulary import SAID

# Metres. Rooms so near each other have a wall in common.
THICKEST_WALL = 0.6


def beside(places: Sequence[Place], other: Place) -> list[Place]:
    """Return the places that touch another one, but for a wall."""
    return [one for one in places if one.geometry.distance(other.geometry) <= THICKEST_WALL]


def opposite(places: Sequence[Place], other: Place) -> list[Place]:
    """Return the nearest place that lies straight across from another one, or several as near."""
    gaps = {one.name: across(one, other) for one in places}
    least = min(gaps.values(), default=float('inf'))
    return [one for one in places if gaps[one.name] < float('inf') and gaps[one.name] <= least]


def across(one: Place, other: Place) -> float:
    """Return the metres between two places that share half of a width, else infinity."""
    mine, theirs = one.geometry.bounds, other.geometry.bounds
    gap = float(one.geometry.distance(other.geometry))
    for low, high in ((0, 2), (1, 3)):
        shared = min(mine[high], theirs[high]) - max(mine[low], theirs[low])
        narrow = min(mine[high] - mine[low], theirs[high] - theirs[low])
        if shared > narrow / 2 and gap > THICKEST_WALL:
            return gap
    return float('inf')


def nearest(places: Sequence[Place], other: Place) -> list[Place]:
    """Return the place nearest to another one, or several that are about as near."""
    return first(places, lambda one: one.geometry.distance(other.geometry))


def farthest(places: Sequence[Place], other: Place) -> list[Place]:
    """Return the place farthest from another one, or several that are about as far."""
    return first(places, lambda one: -one.geometry.distance(other.geometry))


def first(places: Sequence[Place], order: Callable[[Place], float]) -> list[Place]:
    """Return the places with the least number, with those that have hardly more."""
    least = min(map(order, places), default=0.0)
    return [one for one in places if order(one) <= least + THICKEST_WALL]


# Their words are in `patterns.yaml`.
RELATIONS = (beside, opposite, nearest, farthest)
ARTICLES = re.compile(r' (the|der|dem|den|die|das|la|le|l|les|los|las|el)$')


def related(places: Sequence[Place], said: str, other: Place) -> list[Place]:
    """Return those of some places that words put beside another one, [] for other words."""
    words = ARTICLES.sub('', said)
    some = [one for one in places if one.name != other.name]
    found = (way(some, other) for way in RELATIONS if SAID[way.__name__].fullmatch(words))
    return next(found, [])
