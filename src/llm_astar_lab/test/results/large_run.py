"""Run `llm-astar bench` on many samples whose plans are made up; print its peak memory.

python large_run.py FOLDER SAMPLES FORMAT dies after half the rows; run again, it resumes. Both
times it prints the rows and the bytes of resident memory at most.
"""

import json
import os
import resource
import sys
from pathlib import Path

from llm_astar_lab.results.folder import ResultsFolder
from llm_astar_lab.results.row import Row
from llm_astar_lab.runner import engine
from llm_astar_planner.cli.main import main

# Samples of a map, and rows of a sample: every method, five sources.
PAIRS, VARIANTS = 20, 21
# A path as long as those of the paper's maps.
PATH = '5,5;11,12;17,18;23,18;29,25;35,31;41,28;45,20'


def write_dataset(path: Path, samples: int) -> None:
    """Write maps with one barrier and PAIRS samples each."""
    pairs = [[[1, 1], [49, 29]] for _ in range(PAIRS)]
    maps = (
        {'id': number, 'range_x': [0, 51], 'range_y': [0, 31],
         'horizontal_barriers': [[10, 0, 25]], 'vertical_barriers': [], 'start_goal': pairs}
        for number in range(samples // PAIRS)
    )  # fmt: skip
    path.write_text('[' + ',\n'.join(map(json.dumps, maps)) + ']')


def made_up(task: engine.Task) -> list[Row]:
    """Return rows that differ by sample and variant, as fast as they can be made."""
    number = 31 * task.sample.barrier_map.id + task.sample.pair
    work = {variant: 100.0 + number % 97 + 3 * index for variant, index in task.variants}
    return [
        Row(
            *task.sample.key, task.scale, *variant, 'NONE', operation, operation,
            50.0 + number % 7, 0.001, 0.002,
            waypoints='10,12;30,25', verdicts='accepted;occupied',
            path=f'{PATH};{number},{task.sample.pair}', ratio=1.01, clearance=0.5, turns=7.0,
        )
        for variant, operation in work.items()
    ]  # fmt: skip


def peak() -> int:
    """Return the bytes of resident memory that this process took at most."""
    return 1024 * resource.getrusage(resource.RUSAGE_SELF).ru_maxrss


def die_after(rows: int) -> None:
    """End the process, as a crash does, where so many rows have been written."""
    append, written = ResultsFolder.append, 0

    def counted(folder, some):
        nonlocal written
        some = list(some)
        append(folder, some)
        written += len(some)
        if written >= rows:
            sys.stdout.write(json.dumps({'rows': written, 'peak': peak()}) + '\n')
            sys.stdout.flush()
            os._exit(9)

    ResultsFolder.append = counted


def run(folder: Path, samples: int, file_format: str) -> dict[str, int]:
    """Run the benchmark, resume it where there are rows; return rows and peak memory."""
    dataset, out = folder / 'maps.json', folder / 'out'
    words = ['bench', '--map', str(dataset), '--out', str(out), '--format', file_format]
    words += ['--source', 'oracle,straight,random,noisy,reversed']
    engine.run_task = made_up
    if out.exists():
        words.append('--resume')
    else:
        write_dataset(dataset, samples)
        die_after(samples * VARIANTS // 2)
    assert main(words) == 0
    return {'rows': json.loads((out / 'summary.json').read_text())['rows'], 'peak': peak()}


if __name__ == '__main__':
    found = run(Path(sys.argv[1]), int(sys.argv[2]), sys.argv[3])
    sys.stdout.write(json.dumps(found) + '\n')
