"""The training of the embedded waypoint model: maps, labels, export, a smoke run with torch."""

import csv
import signal

import numpy as np
import pytest
from llm_astar_lab.datasets.generate import MapRules, generate
from llm_astar_msgs_adapter.maps.barrier_map import Barrier, BarrierMap, load_barrier_maps
from llm_astar_planner.costmap.costmap import Costmap
from llm_astar_planner.resources import find_file
from llm_astar_planner.search.any_angle import LineOfSightChecker
from llm_astar_planner.waypoints.baselines import shortest_route
from llm_astar_planner.waypoints.learned import (
    featurise,
    hop_logits,
    place_nodes,
    read_weights,
)
from llm_astar_training.batches import (
    HELD_OUT_SEED,
    MAX_BARRIERS,
    greedy_routes,
    held_out,
    make_batch,
    step_batch,
    valid_share,
)
from llm_astar_training.evaluate import figures
from llm_astar_training.export import write_weights
from llm_astar_training.maps import BOXES, KINDS, RECIPE, ROOMS, SCATTERED
from llm_astar_training.routes import lengths_to_goal


@pytest.fixture(scope='module')
def batches():
    return [make_batch(7, kind, 5, 12) for kind in range(len(KINDS))]


def barrier_map_of(barriers, size):
    rows = [(row[0], Barrier(*row[1:])) for row in barriers.tolist()]
    groups = [tuple(barrier for flat, barrier in rows if flat == side) for side in (1, 0)]
    return BarrierMap(0, (0, int(size[0])), (0, int(size[1])), *groups)


def test_the_same_seed_makes_the_same_maps_and_another_seed_makes_others():
    one, again, other = (make_batch(seed, SCATTERED, 5, 8) for seed in (3, 3, 4))
    assert np.array_equal(one.barriers, again.barriers)
    assert np.array_equal(one.hops, again.hops)
    assert not np.array_equal(one.barriers, other.barriers)


def test_lines_of_sight_are_those_of_the_planner(batches):
    """Also where barriers touch, cross or lie side by side, which joins them."""
    crowded = [make_batch(9, kind, 20, 6) for kind in (SCATTERED, ROOMS, BOXES)]
    for batch in [*batches, *crowded]:
        for n, barriers in enumerate(batch.barriers):
            blocked = barrier_map_of(barriers, batch.size[n]).to_grid().blocked()
            nodes = place_nodes(batch.barriers[n : n + 1], batch.endpoints[n : n + 1])[0]
            i, j = np.triu_indices(len(nodes), 1)
            both = batch.usable[n, i] & batch.usable[n, j]
            i, j = i[both], j[both]
            assert not blocked[nodes[i][:, 1], nodes[i][:, 0]].any()
            seen = LineOfSightChecker(blocked).clear(nodes[i], nodes[j])
            assert np.array_equal(np.isfinite(batch.distances[n, i, j]), seen)


def test_the_best_route_over_the_nodes_is_about_the_shortest_path(batches):
    for batch in batches[:2]:
        for n, barriers in enumerate(batch.barriers):
            grid_map = barrier_map_of(barriers, batch.size[n]).to_grid()
            start, goal = (tuple(map(int, end)) for end in batch.endpoints[n])
            best = shortest_route(Costmap(grid_map), start, goal)[1]
            assert best - 1e-3 <= lengths_to_goal(batch.distances[n])[0] <= 1.05 * best + 1


def test_hops_are_probabilities_of_nodes_in_sight_and_the_best_route_reaches_the_goal(batches):
    for batch in batches:
        rows = batch.weights > 0
        assert np.allclose(batch.hops.sum(axis=-1)[rows], 1.0, atol=1e-5)
        assert not batch.hops[~np.isfinite(batch.distances)].any()
        assert (batch.weights[:, 0] == 1).all()
        routes = greedy_routes(np.log(batch.hops + 1e-30), batch.usable)
        assert valid_share(routes, batch.distances) == 1.0


def test_no_training_step_uses_the_seed_of_a_held_out_problem():
    kinds = {(batch.kind, batch.barriers.shape[1]) for batch in held_out(1)}
    assert {kind for kind, _ in kinds} == set(range(len(KINDS)))
    assert max(barriers for _, barriers in kinds) == MAX_BARRIERS
    assert HELD_OUT_SEED > 999 * 4_000_000 + 3_999_999
    with pytest.raises(ValueError, match='seed 1000, step 0'):
        step_batch(1000, 0)
    with pytest.raises(ValueError, match='step 4000000'):
        step_batch(0, 4_000_000)


def test_a_kind_that_is_left_out_is_never_drawn_and_nothing_changes_without(monkeypatch):
    monkeypatch.setattr('llm_astar_training.batches.make_batch', lambda seed, kind, *_: kind)
    kinds = [step_batch(0, step) for step in range(300)]
    assert set(kinds) == set(range(5))
    assert kinds == [step_batch(0, step, left_out=()) for step in range(300)]
    without = [step_batch(0, step, left_out=[ROOMS]) for step in range(300)]
    assert set(without) == set(range(5)) - {ROOMS}


def test_the_benchmarks_maps_are_not_among_the_training_maps():
    known = set()
    for barrier_map in load_barrier_maps(find_file('samples_1000.json', 'maps')):
        rows = [(1, *b) for b in barrier_map.horizontal_barriers]
        rows += [(0, *b) for b in barrier_map.vertical_barriers]
        known.add(frozenset(rows))
    for barriers in range(2, 9):
        for rows in make_batch(barriers, RECIPE, barriers, 300).barriers:
            assert frozenset(map(tuple, rows.tolist())) not in known


def test_exported_weights_are_read_back(tmp_path):
    arrays = {'enter.weight': np.arange(6, dtype=np.float32).reshape(2, 3)}
    write_weights(tmp_path / 'model.npz', arrays, {'layers': 2})
    weights = read_weights((tmp_path / 'model.npz').read_bytes())
    assert dict(weights.shape) == {'layers': 2}
    assert np.array_equal(weights.arrays['enter.weight'], arrays['enter.weight'])


def test_the_model_cards_tables_have_every_source_and_the_oracle():
    (barrier_map,) = generate(5, 1, MapRules(pairs=2))
    found = figures('two pairs', [barrier_map])
    sources = {'embedded', 'embedded-best-of-8', 'straight', 'oracle'}
    assert set(found.alone) == set(found.milliseconds) == sources
    assert set(found.guided) == set(found.paper) == {*sources, 'none'}
    assert found.alone['oracle'].valid.value == 1.0


@pytest.fixture
def train(tmp_path):
    """Return a function that trains for so many steps; it needs torch, of the extra `train`."""
    pytest.importorskip('torch')
    from llm_astar_training.train import main  # noqa: PLC0415

    small = ['--width', '16', '--layers', '1', '--most-maps', '8', '--held-out', '16']
    always = ['--out', str(tmp_path), '--threads', '1', *small]
    return lambda steps, *more: main([*always, '--steps', str(steps), *more])


def steps_of(folder):
    with (folder / 'curve.csv').open() as file:
        return [int(row['step']) for row in csv.DictReader(file)]


def test_training_resumes_where_it_stopped_and_numpy_computes_what_torch_does(train, tmp_path):
    import torch  # noqa: PLC0415
    from llm_astar_training.network import Network, Shape  # noqa: PLC0415

    for steps in (2, 4):
        train(steps)
    assert steps_of(tmp_path) == [2, 4]
    weights = read_weights((tmp_path / 'model.npz').read_bytes())
    network = Network(Shape(**weights.shape))
    network.load_state_dict({k: torch.from_numpy(v) for k, v in weights.arrays.items()})
    for barriers in (0, 1, 5):
        batch = make_batch(1, SCATTERED, barriers, 3)
        features = featurise(batch.barriers, batch.size, batch.endpoints)
        inputs = (features.nodes, features.barriers, features.pairs)
        with torch.no_grad():
            expected = network(*map(torch.from_numpy, inputs)).numpy()
        assert np.allclose(hop_logits(weights, features), expected, atol=1e-4)


def test_an_interrupt_ends_training_after_the_step_and_saves_everything(
    train, tmp_path, monkeypatch, capsys
):
    from llm_astar_training.train import Trainer  # noqa: PLC0415

    learn = Trainer.learn

    def learn_under_interrupt(trainer, batch):
        signal.raise_signal(signal.SIGINT)
        return learn(trainer, batch)

    with monkeypatch.context() as patch:
        patch.setattr(Trainer, 'learn', learn_under_interrupt)
        with pytest.raises(SystemExit) as ended:
            train(2)
    assert ended.value.code == 130
    assert 'continues from here' in capsys.readouterr().out
    train(2)
    assert steps_of(tmp_path) == [1, 2]


def test_a_complete_run_trains_no_more_and_a_checkpoint_of_another_run_is_refused(
    train, tmp_path, capsys
):
    train(1)
    train(1)
    assert 'is trained to the end' in capsys.readouterr().out
    assert steps_of(tmp_path) == [1]
    for other in (['--layers', '2'], ['--seed', '1']):
        with pytest.raises(SystemExit):
            train(2, *other)
        assert 'checkpoint.pt: ' in capsys.readouterr().err
    assert steps_of(tmp_path) == [1]
