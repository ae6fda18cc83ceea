"""Places as RViz and Foxglove draw them."""

import pytest
import shapely
from builtin_interfaces.msg import Time
from llm_astar_msgs_adapter.maps.places import NO_PLACES, Place, Places
from llm_astar_msgs_adapter.messages.markers import (
    places_to_markers,
    reasons_to_markers,
    zones_to_markers,
)
from visualization_msgs.msg import Marker

PLACES = Places(
    [
        Place('hall', shapely.Polygon([(0, 0), (40, 0), (40, 30), (0, 30)])),
        Place('dock', shapely.Point(5, 6), 'object'),
        Place('docks', shapely.MultiPolygon([shapely.box(0, 0, 1, 1), shapely.box(3, 3, 4, 4)])),
    ],
    'floor',
)


def test_every_place_has_its_name_and_outlines_in_one_namespace():
    stamp = Time(sec=3)
    clear, *markers = places_to_markers(PLACES, stamp).markers
    assert (clear.action, clear.header.frame_id) == (Marker.DELETEALL, 'floor')
    assert {(marker.ns, marker.header.frame_id) for marker in markers} == {('places', 'floor')}
    assert [marker.id for marker in markers] == list(range(1, len(markers) + 1))
    assert [marker.text for marker in markers if marker.text] == ['hall', 'dock', 'docks']
    outlines = [marker for marker in markers if marker.type == Marker.LINE_STRIP]
    assert [len(marker.points) for marker in outlines] == [5, 5, 5]
    assert outlines[0].points[0] == outlines[0].points[-1]
    for marker in markers:
        assert marker.header.stamp == stamp
        assert marker.pose.orientation.w == 1.0


def test_names_lie_in_their_place_and_grow_with_the_map():
    names = [marker for marker in places_to_markers(PLACES, Time()).markers if marker.text]
    assert (names[1].pose.position.x, names[1].pose.position.y) == (5.0, 6.0)
    assert names[0].scale.z == pytest.approx(0.6)


def test_no_places_delete_the_last_ones():
    (clear,) = places_to_markers(NO_PLACES, Time()).markers
    assert clear.action == Marker.DELETEALL


def test_zones_have_arrows_and_reasons_are_lines_with_names():
    zone = 'in', shapely.box(0, 0, 2, 2), False, [((1.0, 1.0), (2.0, 1.0))]
    _, text, outline, arrow = zones_to_markers([zone], 'floor', Time()).markers
    assert (text.text, len(outline.points)) == ('in', 5)
    assert (arrow.type, arrow.points[1].x, arrow.scale.y > 0.0) == (Marker.ARROW, 2.0, True)
    reasons = [('spill', [[1.0, 2.0], [3.0, 2.0]]), ('radius', [[5.0, 5.0]])]
    markers = reasons_to_markers(reasons, 'floor', Time())
    assert {marker.ns for marker in markers} == {'reasons'}
    assert [marker.text for marker in markers if marker.text] == ['spill', 'radius']
    line = next(marker for marker in markers if marker.type == Marker.LINE_STRIP)
    assert [point.x for point in line.points] == [1.0, 3.0, 3.0]
