"""Whatever a page sends is a request or a sentence that names what is wrong."""

import json

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from llm_astar_lab.play.maps import Maps, PlayError
from llm_astar_lab.play.request import FIELDS, SOURCES, PlayRequest, read_request
from llm_astar_planner.search.methods import SEARCH_METHODS
from llm_astar_planner.waypoints.source import SOURCES as SOURCE_TABLE

MAPS = Maps()
DEMO = {'map': 'demo.json:0', 'start': [39, 18], 'goal': [7, 19]}
CELLS = st.lists(st.integers(-2, 60), min_size=2, max_size=2)
VALUES = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=20) | CELLS,
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(max_size=8), inner),
    max_leaves=8,
)
WALLS = st.lists(st.lists(st.integers(-2, 110), min_size=3, max_size=3) | VALUES)
BODIES = st.dictionaries(st.sampled_from(sorted(FIELDS)) | st.text(max_size=8), VALUES)


@settings(max_examples=30)
@given(BODIES, WALLS | VALUES, st.sampled_from(SOURCES) | VALUES, CELLS | VALUES)
def test_any_json_is_read_or_refused(body, walls, source, start):
    drawn = json.dumps({'type': 'FeatureCollection', 'features': walls})
    changed = {'walls': walls, 'source': source, 'start': start, 'via': [start], 'drawn': drawn}
    for fields in (source, body, DEMO | body, *(DEMO | {k: v} for k, v in changed.items())):
        check(fields)


def test_a_page_names_no_plug_in_even_where_one_is_loaded(monkeypatch):
    for table, field in ((SEARCH_METHODS, 'method'), (SOURCE_TABLE, 'source')):
        monkeypatch.setitem(table.loaded, 'loaded:name', None)
        for name in ('loaded:name', 'os:getcwd'):
            with pytest.raises(PlayError, match=f"{field}: '{name}' is not one of"):
                read_request(DEMO | {field: name}, MAPS)


def check(fields):
    try:
        request = read_request(fields, MAPS)
    except PlayError as error:
        assert str(error)
        assert error.field in FIELDS | {''}
        return
    assert isinstance(request, PlayRequest)
    assert request.edited_map().cells.shape == request.play_map.grid_map.cells.shape
