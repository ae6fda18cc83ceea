"""Drive missions with several planners at the same time, and write the table of what was measured.

LLM_ASTAR_NAV2=/opt/ros/jazzy python -m nav2_stack --out ../out/nav2 --table
"""

import argparse
import datetime
import os
import subprocess
import sys
from pathlib import Path

from nav2_stack.processes import MISSING, PLUGINS, environment, has_nav2
from nav2_stack.table import write_table

# Domains, one for each planner, away from a robot's usual ones and from those of the tests, and
# others for each process: two drives at a time must not meet.
DOMAINS = 102, 120
SCENARIOS = ('plain=30', 'boxes=10', 'moving=10', 'door=5', 'goal=5', 'kill=3')
# Those that are driven on the first map alone, the door on the map that has one.
ONCE = ('door', 'goal', 'kill')


def main():
    """Return 0 when all has been driven, 2 where Nav2 is not installed."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument('--planners', nargs='+', choices=PLUGINS, default=['ours', 'navfn'])
    parser.add_argument('--maps', nargs='+', default=['depot', 'warehouse'])
    parser.add_argument(
        '--scenarios', nargs='+', default=SCENARIOS, metavar='NAME=COUNT',
        help=f'how many missions of which scenario: {" ".join(SCENARIOS)}',
    )  # fmt: skip
    parser.add_argument('--seed', type=int, default=1)
    parser.add_argument('--noise', type=float, default=0.0, help='of the localization, in metres')
    parser.add_argument('--out', type=Path, required=True, help='a folder for measures and logs')
    parser.add_argument('--table', type=Path, help='a Markdown file for the table')
    given = parser.parse_args()
    if not has_nav2():
        sys.stderr.write(f'{MISSING}\n')
        return 2
    given.out.mkdir(parents=True, exist_ok=True)
    for scenario, count in (words.split('=') for words in given.scenarios):
        for name in given.maps[: 1 if scenario in ONCE else None]:
            drive_together(given, name, scenario, count)
    if given.table:
        command = 'python -m nav2_stack ' + ' '.join(sys.argv[1:])
        write_table(given.out, given.table, command, datetime.date.today())
    return 0


def drive_together(given, name, scenario, count):
    """Drive one scenario with all planners at the same time, each in a domain of its own."""
    options = ['--count', count, '--seed', given.seed, '--noise', given.noise]
    running = []
    for number, planner in enumerate(given.planners):
        domain = DOMAINS[0] + (len(PLUGINS) * os.getpid() + number) % DOMAINS[1]
        words = [sys.executable, '-m', 'nav2_stack.missions', planner, name, scenario]
        words += [str(word) for word in [*options, '--out', given.out]]
        with (given.out / f'{name}-{scenario}-{planner}.log').open('wb') as log:
            running.append(
                subprocess.Popen(words, env=environment(domain), stdout=log, stderr=log)
            )
    for process in running:
        process.wait()


if __name__ == '__main__':
    raise SystemExit(main())
