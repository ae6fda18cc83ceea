"""What a prepared grid checks and holds."""

import numpy as np
import pytest
from grids import held_bytes, shortest_path
from llm_astar_planner.search import grid_graph
from llm_astar_planner.search.astar import exact_astar
from llm_astar_planner.search.grid_graph import GridGraph


def test_costs_and_shapes_are_checked():
    free = np.zeros((3, 3), dtype=bool)
    with pytest.raises(ValueError, match='cost: shape'):
        GridGraph(free, cost=np.zeros((2, 3)))
    with pytest.raises(ValueError, match='cost_multiplier'):
        GridGraph(free, cost=np.zeros((3, 3)), cost_multiplier=-1.0)
    with pytest.raises(ValueError, match='blocked: shape'):
        GridGraph(np.zeros(3, dtype=bool))


def test_memory_is_at_most_twenty_bytes_per_cell():
    grid = GridGraph(np.zeros((512, 512), dtype=bool))
    exact_astar(grid, (0, 0), (511, 300), want_expanded=False)
    assert held_bytes(grid) / grid.moves.size <= 20.0


def test_results_stay_right_when_the_query_numbers_run_out():
    grid = GridGraph(np.zeros((4, 9), dtype=bool))
    workspace = grid.borrow()
    workspace.generation = grid_graph.MAX_GENERATION - 2
    grid.give_back(workspace)
    assert [shortest_path(grid, (0, 0), (8, 3))[1] for _ in range(5)] == [
        shortest_path(GridGraph(grid.blocked), (0, 0), (8, 3))[1]
    ] * 5


def test_a_cell_among_free_cells_has_all_eight_moves():
    moves = GridGraph(np.zeros((3, 3), dtype=bool)).moves
    assert moves[4] == 0xFF
    assert int(moves[0]).bit_count() == 3
