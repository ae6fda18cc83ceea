"""The page docs/nav2-missions.md, from the measures of missions."""

import json
import os
import platform
from collections import Counter
from statistics import median

from nav2_stack.measures import median_ratio, pairs, setting_of, total
from nav2_stack.processes import nav2_version

NAMES = {'ours': 'planner_node', 'navfn': 'NavFn', 'smac': 'Smac 2D'}
SCENARIOS = {
    'plain': 'plain missions',
    'boxes': 'with 14 boxes that only the laser sees',
    'moving': 'with 6 boxes that move, up to 0.6 m/s',
    'door': 'a door shuts in front of the robot',
    'goal': 'the goal changes on the way',
    'kill': 'the process that plans is killed (kill -9) on the way',
}
# A row in which all planners have this is left out.
NOTHING = {'0', '0, 0', '0.0 %'}
OF_WHOLE_PROCESSES = ('goal to first plan, median (p95)', 'plans', 'CPU of what plans')
RATIOS = {
    'planned': 'planned length',
    'driven': 'driven',
    'turning': 'turning',
    'seconds': 'time',
}
HEAD = """\
# Missions in a whole Nav2

What a robot does with this planner and with NavFn, in the same Nav2 at the same time: \
bt_navigator with its default tree, controller_server with Regulated Pure Pursuit at 1 m/s, \
behavior_server, both costmaps with the obstacle layer, and the processes of `nav2.launch.py` \
with `config/nav2.yaml`. The robot, its odometry and its laser are simulated (`test/nav2_stack/`, \
a process for each planner); everything else is Nav2's own. Starts and goals are the same for \
all. Maps are Nav2's `depot` and `warehouse`; the door is on a depot made from a seed.

planner_server holds the global costmap, so it runs beside planner_node, and both count. A killed \
process is started again at once. Bumps, recoveries, foreseen collisions, warnings and time near \
obstacles are left out where all have none.
"""


def read(folder):
    """Return the measures of all missions in a folder."""
    lines = (folder / 'missions.jsonl').read_text().splitlines()
    return [json.loads(line) for line in lines]


def write_table(folder, page, command, today):
    """Write the page: the command, then a section for each map and scenario."""
    rows = read(folder)
    loads = [row['load'] for row in rows]
    lines = [
        HEAD,
        f'Nav2 {nav2_version()} (jazzy, Release build); Python {platform.python_version()}, '
        f'{os.cpu_count()} cores, {platform.machine()}; {today}, seed {rows[0]["seed"]}. '
        f'The load average was {min(loads):.1f} to {max(loads):.1f}, median {median(loads):.1f}, '
        'so ratios of pairs are what to look at. In `test/`:\n',
        f'```sh\n{command}\n```\n',
    ]
    lines += summary(rows)
    for setting in dict.fromkeys(map(setting_of, rows)):
        lines += section(setting, [row for row in rows if setting_of(row) == setting])
    page.write_text('\n'.join(lines).rstrip() + '\n')


def summary(rows):
    """Return the table of the aims: medians of pairs over NavFn, of the first setting."""
    rows = [row for row in rows if setting_of(row)[2:] == setting_of(rows[0])[2:]]
    maps = list(dict.fromkeys(row['map'] for row in rows))
    lines = ['## What is aimed at\n', f'| over NavFn | aim | {" | ".join(maps)} |']
    lines.append('|---' * (2 + len(maps)) + '|')
    for what, (aim, scenario, value) in AIMS.items():
        cells = []
        for name in maps:
            of_name = [r for r in rows if (r['map'], r['scenario']) == (name, scenario)]
            both = pairs(of_name, 'ours', 'navfn')
            cells.append(value(both) if both else '-')
        lines.append(f'| {what} | {aim} | {" | ".join(cells)} |')
    return [*lines, '']


def ratio_of(name):
    return lambda both: f'{median_ratio(both, name):.3f}'


def sums_of(name, form='{:.0f}'):
    """Return a function that writes a sum over all missions, and NavFn's in brackets."""

    def write(both):
        ours, navfn = (
            form.format(sum(read_value(row, name) for row in rows)) for rows in zip(*both)
        )
        return f'{ours} ({navfn})'

    return write


def read_value(row, name):
    value = row[name]
    return len(value) if isinstance(value, list) else value


def share_near(both):
    near = [100 * total(rows, 'near') / total(rows, 'seconds') for rows in zip(*both)]
    return f'{near[0]:.1f} % ({near[1]:.1f} %)'


def first_plan(both):
    ours, navfn = (
        median(row['first_plan_ms'] for row in rows if row['first_plan_ms']) for rows in zip(*both)
    )
    return f'{ours:.0f} ms ({navfn:.0f} ms)'


def whole(name):
    """Return a function that writes a ratio of what all processes that plan take."""
    together = sum if name == 'cpu' else max

    def write(both):
        ours, navfn = (together(sum(row[name].values()) for row in rows) for rows in zip(*both))
        return f'{ours / navfn:.2f}'

    return write


# What is aimed at, in which scenario, and what writes the measure of pairs.
AIMS = {
    'arrived': ('as NavFn', 'plain', sums_of('arrived')),
    'planned length': ('0.99', 'plain', ratio_of('planned')),
    'driven': ('0.99', 'plain', ratio_of('driven')),
    'turning': ('0.85', 'plain', ratio_of('turning')),
    'time': ('0.99', 'plain', ratio_of('seconds')),
    'goal to first plan': ('25 ms', 'plain', first_plan),
    'CPU of what plans': ('1.5', 'plain', whole('cpu')),
    'memory of what plans': ('3', 'plain', whole('memory')),
    'WARN and ERROR lines of what plans': ('no more', 'plain', sums_of('warned')),
    'with boxes: recoveries': ('no more', 'boxes', sums_of('recoveries')),
    'with boxes: "collision ahead"': ('no more', 'boxes', sums_of('collisions')),
    'with boxes: time within 0.35 m': ('no more', 'boxes', share_near),
}


def section(setting, rows):
    """Return the lines about the drives of one setting."""
    map_name, scenario, _, noise = setting
    planners = [planner for planner in NAMES if any(row['planner'] == planner for row in rows)]
    named = [f'{map_name}: {SCENARIOS[scenario]}']
    named += [f'localized off by {100 * noise:.0f} cm'] if noise else []
    named += [f'with {NAMES["smac"]}'] if 'smac' in planners else []
    lines = [f'## {", ".join(named)}\n']
    lines.append('| | ' + ' | '.join(NAMES[planner] for planner in planners) + ' |')
    lines.append('|---' * (len(planners) + 1) + '|')
    columns = [totals([row for row in rows if row['planner'] == one]) for one in planners]
    for what in columns[0]:
        cells = [column[what] for column in columns]
        if not NOTHING.issuperset(cells):
            lines.append(f'| {what} | ' + ' | '.join(cells) + ' |')
    lines.append('')
    for other in planners[1:]:
        lines += compared(rows, planners[0], other)
    return lines


def compared(rows, planner, other):
    """Return a sentence with the medians of the ratios of pairs, none where no pair arrived."""
    both = pairs(rows, planner, other)
    ratios = {what: median_ratio(both, name) for name, what in RATIOS.items()}
    if None in ratios.values():
        return []
    listed = ', '.join(f'{what} {ratio:.3f}' for what, ratio in ratios.items())
    return [f'Medians of pairs over {NAMES[other]}: {listed}.\n']


def totals(rows):
    """Return what one planner did in all missions, as texts."""
    seconds = total(rows, 'seconds')
    cpu = Counter()
    for row in rows:
        cpu.update(row['cpu'])
    first = sorted(row['first_plan_ms'] for row in rows if row['first_plan_ms'] is not None)
    memory = {name: max(row['memory'].get(name, 0.0) for row in rows) for name in cpu}
    warned = sum(len(row['warned']) for row in rows)
    failed = Counter(row['code'] for row in rows if not row['arrived'])
    codes = ', '.join(f'{count} by code {code}' for code, count in failed.items())
    arrived = f'{sum(row["arrived"] for row in rows)} of {len(rows)}'
    killed = [row.get('back') for row in rows if row['scenario'] == 'kill']
    again = ', '.join('never' if one is None else f'{one:.1f} s' for one in killed)
    lines = {
        'arrived': arrived + (f' ({codes})' if codes else ''),
        **({'a plan again, after the mission has ended': again} if killed else {}),
        'time, driven': f'{seconds:.0f} s, {total(rows, "driven"):.0f} m',
        'time within 0.35 m of obstacles': f'{100 * total(rows, "near") / seconds:.1f} %',
        'bumps': f'{total(rows, "bumps")}',
        'recoveries, in missions': f'{total(rows, "recoveries")}, '
        f'{sum(row["recoveries"] > 0 for row in rows)}',
        '"collision ahead" of the controller': f'{total(rows, "collisions")}',
        'goal to first plan, median (p95)': f'{median(first):.0f} ms '
        f'({first[int(0.95 * (len(first) - 1))]:.0f} ms)'
        if first
        else '-',
        'plans': f'{total(rows, "plans")}',
        'WARN and ERROR lines of what plans': f'{warned}',
        'CPU of what plans': f'{sum(cpu.values()):.1f} s' + by_process(cpu, '{:.1f}'),
        'memory of what plans': f'{sum(memory.values()):.0f} MB' + by_process(memory, '{:.0f}'),
    }
    if killed:
        # Of processes that begin anew these say nothing.
        lines = {what: text for what, text in lines.items() if what not in OF_WHOLE_PROCESSES}
    return lines


def by_process(values, form):
    if len(values) < 2:
        return ''
    return ' (' + ', '.join(f'{name} {form.format(value)}' for name, value in values.items()) + ')'
