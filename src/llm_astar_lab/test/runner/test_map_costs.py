"""What maps cost before their queries: time, memory that is really held, query times by map."""

import json
import tracemalloc

import numpy as np
import pytest
from llm_astar_lab.datasets.generate import generate_family
from llm_astar_lab.report.tables import map_cost_table
from llm_astar_lab.results.row import Row
from llm_astar_lab.results.stored_rows import StoredRows
from llm_astar_lab.runner.map_costs import add_query_times, held_bytes, map_costs
from llm_astar_planner.cli import main as cli
from reader_files import write_movingai


def test_arrays_are_counted_once_with_what_their_views_hold():
    class Holder:
        def __init__(self):
            self.whole = np.zeros(1000, dtype=np.int32)
            self.parts = {'a': self.whole[:10], 'again': [self]}
            self.other = np.zeros((10, 10))[::2]

    assert held_bytes(Holder()) == 4000 + 800
    assert held_bytes(lambda: Holder) == 0


def test_the_memory_of_a_planner_is_about_what_python_says_it_takes():
    (problem,) = generate_family('rooms', 0, 1, 1, side=401)
    list(map_costs([problem], {}))  # what the first planner of all loads
    tracemalloc.start()
    measured = map_costs([problem], {0: 'rooms.map'})
    cost = next(measured)  # which holds the planner
    held, _ = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert 0.8 * held < cost['bytes'] < 1.2 * held
    assert cost['seconds'] > 0
    assert (cost['name'], cost['family'], cost['width']) == ('rooms.map', 'rooms', 401)


def test_query_times_are_those_of_the_maps_rows():
    rows = [
        Row(number, pair, scale, 'astar', 'none', '', '', 'NONE', seconds_search=seconds)
        for number, pair, scale, seconds in (
            (0, 0, 1, 0.1), (0, 1, 1, 0.3), (0, 1, 2, 9.0), (1, 0, 1, 0.7),
        )
    ]  # fmt: skip
    costs = [{'map': 0}, {'map': 1}, {'map': 2}]
    add_query_times(costs, StoredRows.of(rows))
    first, second, third = (cost['queries'] for cost in costs)
    assert first['astar/none']['count'] == 2
    assert first['astar/none']['median'] == pytest.approx(0.2)
    assert first['astar/none']['worst'] == 0.3
    assert second['astar/none']['mean'] == 0.7
    assert third == {}


def test_a_run_of_a_set_reports_them_by_map(tmp_path, monkeypatch):
    monkeypatch.setattr('llm_astar_lab.report.write.draw_all', lambda *_: [])
    write_movingai(tmp_path)
    out = tmp_path / 'out'
    words = ('bench', '--dataset', 'movingai/street', '--path', str(tmp_path), '--out', str(out))
    assert cli.main([*words, '--methods', 'exact_astar', '--source', 'none']) == 0
    metadata = json.loads((out / 'metadata.json').read_text())
    (cost,) = metadata['map_costs']
    assert (cost['name'], cost['family']) == ('x', 'movingai/street')
    assert cost['queries']['exact_astar/none']['count'] == 10
    assert '## Preprocessing, memory and queries by map' in (out / 'report.md').read_text()
    table = map_cost_table(metadata)
    assert [len(row) for row in table.rows] == [len(table.columns)]
    assert cli.main(['report', str(out)]) == 0
    # A file that somebody else wrote is no traceback.
    metadata['map_costs'] = [{'map': 0, 'queries': 3}]
    (out / 'metadata.json').write_text(json.dumps(metadata))
    assert cli.main(['report', str(out)]) == 2
