"""Places on a map: named areas and objects, read from GeoJSON in the map's frame."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import shapely
from shapely.geometry import mapping
from shapely.geometry.base import BaseGeometry

from llm_astar_msgs_adapter.errors import LlmAstarError

# The kind of a place that nobody can stand in: a rack, a machine, a wall.
OBJECT = 'object'
DEFAULT_KIND = 'area'


class PlacesError(LlmAstarError, ValueError):
    """A malformed places file; the message names the feature and the field."""


@dataclass(frozen=True)
class Place:
    """A named part of the map: `geometry` is a shapely polygon or point, metres, map frame.

    `kind` says what it is ('room', 'door', 'object', ...), `tags` what else is true of it
    ('blue'). A place of kind or tag `object` is visited by coming near it.
    """

    name: str
    geometry: BaseGeometry
    kind: str = DEFAULT_KIND
    aliases: tuple[str, ...] = ()
    tags: tuple[str, ...] = ()

    @property
    def is_object(self) -> bool:
        """Whether it is visited by coming near it instead of entering it."""
        return OBJECT in (self.kind, *self.tags)


class Places:
    """The places of a map, by name. Immutable; names and aliases are compared without case."""

    def __init__(self, places: Iterable[Place] = (), frame_id: str = 'map') -> None:
        """Take places. Raises PlacesError where two have one name or alias."""
        self.places = tuple(places)
        self.frame_id = frame_id
        self._by_name: dict[str, Place] = {}
        for place in self.places:
            for name in (place.name, *place.aliases):
                other = self._by_name.setdefault(name.casefold(), place)
                if other is not place:
                    raise PlacesError(f'{name!r} names both {other.name!r} and {place.name!r}')

    def __iter__(self) -> Iterator[Place]:
        """Iterate over the places in the file's order."""
        return iter(self.places)

    def __len__(self) -> int:
        """Count the places."""
        return len(self.places)

    def get(self, name: str) -> Place | None:
        """Return the place with a name or alias, or None."""
        return self._by_name.get(name.casefold())

    def with_tag(self, tag: str) -> tuple[Place, ...]:
        """Return the places of a kind or with a tag."""
        wanted = tag.casefold()
        return tuple(
            place
            for place in self.places
            if wanted in {name.casefold() for name in (place.kind, *place.tags)}
        )

    @property
    def tags(self) -> tuple[str, ...]:
        """All kinds and tags, each once, in order of appearance."""
        return tuple(dict.fromkeys(t for place in self.places for t in (place.kind, *place.tags)))

    @cached_property
    def digest(self) -> str:
        """Twelve hex digits that identify the places: names, aliases, kinds, tags, geometry."""
        return hashlib.sha256(json.dumps(self.to_geojson(), sort_keys=True).encode()).hexdigest()[
            :12
        ]

    def to_geojson(self) -> dict[str, object]:
        """Return the FeatureCollection."""
        return {
            'type': 'FeatureCollection',
            'features': [
                {
                    'type': 'Feature',
                    'geometry': mapping(place.geometry),
                    'properties': {
                        'name': place.name,
                        'aliases': list(place.aliases),
                        'kind': place.kind,
                        'tags': list(place.tags),
                    },
                }
                for place in self.places
            ],
        }


NO_PLACES = Places()


def places_from_polygons(entries: Mapping[str, Mapping[str, Any]]) -> Places:
    """Return places from `{name: {polygon, aliases, kind, tags}}`, the form of suites."""
    return Places(
        Place(
            name,
            shapely.Polygon(entry['polygon']),
            str(entry.get('kind', DEFAULT_KIND)),
            tuple(entry.get('aliases', ())),
            tuple(entry.get('tags', ())),
        )
        for name, entry in entries.items()
    )
