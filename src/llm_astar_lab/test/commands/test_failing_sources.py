"""A source that fails is called a failure, in the first sentence of the report and beside its row.

Sources of a plug-in fail on all or some samples, are late, or answer without a list.
"""

import sys

import pytest
from llm_astar_lab.datasets.generate import generate
from llm_astar_msgs_adapter.maps.problem_maps import save_maps
from llm_astar_planner.cli.main import parse
from llm_astar_planner.waypoints.baselines import baseline_sources
from llm_astar_planner.waypoints.source import SourceStatus, WaypointReply


class Planted:
    """The oracle, of which every so many queries get something else."""

    name = 'planted'
    every, fault = 1, None

    def __init__(self, _):
        self.asked, self.oracle = 0, baseline_sources()['oracle']

    def waypoints(self, query):
        self.asked += 1
        if self.asked % self.every == 0:
            return type(self).fault()
        return self.oracle.waypoints(query)


def fail():
    message = 'no such host'
    raise OSError(message)


def come_late():
    return WaypointReply(status=SourceStatus.TIMEOUT)


def ramble():
    return WaypointReply(text='go left', status=SourceStatus.MALFORMED)


@pytest.fixture
def report(tmp_path, monkeypatch):
    """Return the finding and the row of the planted source with a fault every so often."""
    monkeypatch.setitem(sys.modules, 'planted', sys.modules[__name__])
    save_maps(list(generate(9, 4)), tmp_path / 'maps.json')

    def run(fault, every):
        monkeypatch.setattr(Planted, 'fault', staticmethod(fault))
        monkeypatch.setattr(Planted, 'every', every)
        words = [
            'bench', '--map', tmp_path / 'maps.json', '--limit', 20, '--methods', 'llm_astar',
            '--source', 'planted:Planted', '--out', tmp_path / 'out',
        ]  # fmt: skip
        args = parse([str(word) for word in words])
        args.run(args)
        lines = (tmp_path / 'out/report.md').read_text().splitlines()
        row = next(line for line in lines if 'planted:Planted' in line and line[0] == '|')
        return lines[2], row

    return run


@pytest.mark.parametrize(
    ('fault', 'status'), [(fail, 'ERROR'), (come_late, 'TIMEOUT'), (ramble, 'MALFORMED')]
)
def test_a_source_that_always_fails_is_said_to_have_added_nothing_that_is_known(
    report, fault, status
):
    finding, row = report(fault, 1)
    assert finding.startswith(f'The source failed on 20 of 20 samples ({status} 20): nothing')
    assert f'{status} 20' in row


@pytest.mark.parametrize(
    ('fault', 'status'), [(fail, 'ERROR'), (come_late, 'TIMEOUT'), (ramble, 'MALFORMED')]
)
def test_the_finding_gives_the_share_without_the_failed_samples(report, fault, status):
    finding, row = report(fault, 10)
    assert finding.startswith(f'The source failed on 2 of 20 samples ({status} 2), with these the')
    assert 'without them' in finding
    assert finding.endswith('over 18 samples.')
    assert f'{status} 2' in row
