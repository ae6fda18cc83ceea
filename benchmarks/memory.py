"""What a planner adds to a process's memory: each in a process of its own.

`python -m benchmarks.memory CASE.npz PLANNER` prints one measurement. It is the growth of the
resident set beside the map, which is there before.
"""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

from llm_astar_planner.search.astar import exact_astar
from llm_astar_planner.search.grid_graph import GridGraph

from benchmarks.cases import Problem, SpeedCase
from benchmarks.ours import EXACT, Prepared, prepare_planner
from benchmarks.peers import PEERS, Plan

PLANNER = 'Planner.plan'
KIB = 1024


def measure(case: SpeedCase, path: Path) -> dict[str, dict[str, float]]:
    """Return `peak` and `held` bytes a cell of each planner on the case saved at `path`."""
    peers = [peer.name for peer in PEERS if peer.reason_to_skip(case) is None]
    found = {}
    for name in (EXACT, PLANNER, *peers):
        command = [sys.executable, '-m', 'benchmarks.memory', str(path), name]
        output = subprocess.run(command, check=True, capture_output=True, text=True).stdout  # noqa: S603
        found[name] = json.loads(output)
    return found


def prepare(name: str, problem: Problem) -> Plan:
    """Prepare a planner by its name, ours or a peer."""
    if name == EXACT:
        grid = GridGraph(problem.blocked)
        return lambda start, goal: exact_astar(grid, start, goal, want_expanded=False).path
    if name == PLANNER:
        return prepare_planner(Prepared(problem), any_angle=False)
    return next(peer for peer in PEERS if peer.name == name).prepare(problem)


def resident(field: str) -> int:
    """Return a field of this process's status in bytes: VmRSS, or VmHWM, the highest of it."""
    for line in Path('/proc/self/status').read_text(encoding='ascii').splitlines():
        if line.startswith(f'{field}:'):
            return int(line.split()[1]) * KIB
    raise OSError(f'/proc/self/status has no {field}')


def grow(name: str, problem: Problem) -> dict[str, float]:
    """Answer the queries of a problem; return the bytes a cell that this took and holds."""
    tiny = Problem(problem.blocked[:40, :40] & False, (((1, 1), (30, 30)),), graded=problem.graded)
    plan = prepare(name, tiny)
    plan(*tiny.queries[0])
    _ = problem.grid_map
    Path('/proc/self/clear_refs').write_text('5', encoding='ascii')
    before = resident('VmRSS')
    plan = prepare(name, problem)
    for start, goal in problem.queries[:3]:
        plan(start, goal)
    cells = problem.blocked.size
    peak, held = (resident(field) - before for field in ('VmHWM', 'VmRSS'))
    return {'peak': peak / cells, 'held': held / cells}


if __name__ == '__main__':
    (only,) = SpeedCase.load(Path(sys.argv[1])).problems
    sys.stdout.write(json.dumps(grow(sys.argv[2], only)))
