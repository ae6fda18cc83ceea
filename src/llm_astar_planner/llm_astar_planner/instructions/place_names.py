"""Which place a name means, or which names there are to choose from."""

from __future__ import annotations

from llm_astar_msgs_adapter.errors import LlmAstarError
from llm_astar_msgs_adapter.maps.places import Place, Places

from llm_astar_planner.parameter import nearest_name

# Names listed in an error.
MAX_LISTED = 30


class PlaceGoalError(LlmAstarError, ValueError):
    """A name that is no goal; the message lists the names that are."""


def find_place(name: str, places: Places) -> Place:
    """Return the place that a name, an alias, or a kind or tag of one place alone means.

    Raises PlaceGoalError with the names to choose from.
    """
    wanted = ' '.join(name.split())
    place = places.get(wanted)
    if place is not None:
        return place
    tagged = places.with_tag(wanted)
    if len(tagged) == 1:
        return tagged[0]
    if tagged:
        raise PlaceGoalError(f'{wanted!r} is said of several places: {listed(Places(tagged))}')
    if not len(places):
        raise PlaceGoalError(
            f'there is no place {wanted[:80]!r}, as no places are loaded: name their file with '
            '--places, or places_file in the node'
        )
    near = nearest_name(wanted, [name for p in places for name in (p.name, *p.aliases)])
    raise PlaceGoalError(f'there is no place {wanted[:80]!r}{near}; there is {listed(places)}')


def listed(places: Places) -> str:
    """Return the names of places for an error."""
    names = [place.name for place in places]
    more = f' and {len(names) - MAX_LISTED} more' if len(names) > MAX_LISTED else ''
    return ', '.join(names[:MAX_LISTED]) + more
