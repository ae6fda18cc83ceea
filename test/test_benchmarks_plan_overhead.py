from benchmarks import plan_overhead
from benchmarks.plan_overhead import Variant


def test_every_variant_is_timed_on_every_map(capsys):
    assert plan_overhead.main(['--maps', '1', '--rounds', '1', '--size', '120']) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[0].split()[:2] == ['map', 'method']
    assert sum(line.startswith('51x31') for line in lines) == len(plan_overhead.VARIANTS)
    assert any(line.startswith('120x120, graded') for line in lines)
    assert all(float(line.split()[-2]) > 0.0 for line in lines[1:])


def test_a_variant_asks_for_what_it_is_named_after():
    (query, *_) = plan_overhead.barrier_queries(1)
    assert query.planner.landmarks.current is not None
    (row,) = plan_overhead.measure('demo', [query], [Variant('guided', landmarks=True)], rounds=2)
    assert row.variant.landmarks
    assert row.plan > 0.0
