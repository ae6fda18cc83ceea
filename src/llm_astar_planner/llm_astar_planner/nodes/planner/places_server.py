# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""The named places of the map: their file, their markers, and which goal each means."""

import contextlib
import json
from collections.abc import Hashable
from typing import Any

from llm_astar_msgs_adapter.errors import LlmAstarError
from llm_astar_msgs_adapter.maps.places import NO_PLACES, Places, load_places, places_problems
from llm_astar_msgs_adapter.messages.markers import places_to_markers
from rcl_interfaces.msg import SetParametersResult
from std_msgs.msg import String
from visualization_msgs.msg import MarkerArray

from llm_astar_planner.instructions.grammar.vocabulary import check_names
from llm_astar_planner.instructions.region_finder import goal_cell
from llm_astar_planner.instructions.route import PlaceGoalError
from llm_astar_planner.nodes.common.entities import LATCHED, Entities, LoggedThread
from llm_astar_planner.nodes.common.parameters import Parameters
from llm_astar_planner.planning.planner import Planner
from llm_astar_planner.resources import find_file

PARAMETER = 'places_file'


def load(name: str) -> Places:
    """Return the places of a file, none for ''. Raises PlacesError or OSError."""
    return check_names(load_places(find_file(name, 'maps')), name) if name else NO_PLACES


class PlacesServer:
    """Publishes the places of the parameter `places_file`, and the goal that each means.

    A file that is refused keeps the last places. To read a changed file again, set its name again.
    """

    def __init__(self, entities: Entities, settings: Parameters) -> None:
        """Publish the places; their goals follow when there is a map.

        Raises PlacesError or FileNotFoundError.
        """
        self._node = node = entities.node
        self._settings = settings
        name = settings[PARAMETER]
        self._loaded = {name: load(name)}
        node.add_on_set_parameters_callback(self.on_set)
        entities.on_close(lambda: node.remove_on_set_parameters_callback(self.on_set))
        self._published: Places | None = None
        self._planner: Planner | None = None
        self._checked: Hashable = None
        self._is_queued = False
        self._markers = entities.publisher(MarkerArray, '~/places', LATCHED)
        self._geojson = entities.publisher(String, '~/places_geojson', LATCHED)
        # Of its own, since a large map with many places takes seconds.
        self._thread = LoggedThread(entities, 'places', drops_rest=True)
        self.refresh()

    @property
    def places(self) -> Places:
        """The places of the file that is set."""
        return self._loaded[self._settings[PARAMETER]]

    def on_set(self, changed: list[Any]) -> SetParametersResult:
        """Load the file that is to be set; refuse one that cannot be read."""
        for change in changed:
            if change.name == PARAMETER:
                try:
                    places = load(change.value)
                except (LlmAstarError, OSError) as error:
                    return SetParametersResult(successful=False, reason=str(error))
                # The file before stays known: another check may still refuse the change.
                before = self._settings[PARAMETER]
                self._loaded = {before: self._loaded[before], change.value: places}
        return SetParametersResult(successful=True)

    def refresh(self) -> None:
        """Publish the places if they have changed."""
        if self.places is not self._published:
            self._published = self.places
            stamp = self._node.get_clock().now().to_msg()
            self._markers.publish(places_to_markers(self.places, stamp))
            self._geojson.publish(String(data=json.dumps(self.places.to_geojson())))
            self.check_soon()

    def on_planner(self, planner: Planner) -> None:
        """Plan goals on a new map from now on."""
        self._planner = planner
        if len(self.places):
            self.check_soon()

    def check_soon(self) -> None:
        """Check the places on the thread, once for all maps that come until then."""
        if not self._is_queued:
            self._is_queued = True
            self._thread.run(self.publish_goals)

    def publish_goals(self) -> None:
        """Check the places on the map and publish the goal of each.

        That is done once for a map of this size and position: a costmap changes every second, and
        a goal that has become blocked is replaced when it is planned to.
        """
        self._is_queued = False
        planner, places = self._planner, self.places
        if planner is None or not len(places):
            return
        checked = (places.digest, planner.grid_map.layout, planner.config)
        if checked == self._checked:
            return
        self._checked = checked
        for problem in places_problems(places, planner.grid_map):
            self._node.get_logger().warning(f'places: {problem}')
        goals: dict[str, list[float]] = {}
        for place in places:
            with contextlib.suppress(PlaceGoalError):
                cell = goal_cell(place, planner.costmap)
                goals[place.name] = planner.grid_map.grid_to_world([cell])[0].tolist()
        self._geojson.publish(String(data=json.dumps(places.to_geojson() | {'goals': goals})))
