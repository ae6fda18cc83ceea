"""`llm-astar plan` starts fast: it imports only what the plan takes."""

import json
import subprocess
import sys

import pytest
from llm_astar_planner.cli.main import main

# Not scipy.linalg, which numba imports by itself.
HEAVY = {
    'httpx', 'lark', 'matplotlib', 'scipy.ndimage', 'rclpy', 'duckdb',
    'llm_astar_planner.planning.why', 'llm_astar_planner.instructions.specification',
}  # fmt: skip
CODE = """
import json, sys
from llm_astar_planner.cli.main import main
code = main(sys.argv[1:])
print(json.dumps([code, sorted(sys.modules)]))
"""


def modules_after(*arguments):
    process = subprocess.run(
        [sys.executable, '-c', CODE, *arguments], capture_output=True, text=True, check=True
    )
    code, modules = json.loads(process.stdout.splitlines()[-1])
    assert code == 0, process.stdout
    return set(modules)


def test_a_plain_plan_imports_none_of_the_large_libraries():
    assert not modules_after('plan') & HEAVY
    ends = '--start', '-5.7', '-2.4', '--goal', '18.8', '7.8'
    assert not modules_after('plan', '--map', 'depot', *ends) & HEAVY


def test_a_plan_between_places_reads_no_vocabulary():
    modules = modules_after('plan', '--map', 'depot', '--from', 'dock 1', '--to', 'workshop')
    assert 'llm_astar_planner.instructions.grammar.vocabulary' not in modules


@pytest.mark.parametrize(
    ('arguments', 'library'),
    [
        (['--instruction', 'avoid 12, 4 by 2 m'], 'lark'),
        (['--source', 'oracle'], 'scipy.sparse.csgraph'),
    ],
)
def test_what_a_plan_needs_is_imported(arguments, library):
    assert library in modules_after('plan', *arguments)


@pytest.mark.parametrize('ends', [[], ['--start', '5', '5', '--goal', '45', '20']])
def test_the_demo_is_planned_without_numba_with_the_same_answer(ends, capsys):
    options = ['-W', 'error', '-X', 'importtime']
    command = [sys.executable, *options, '-m', 'llm_astar_planner.cli', 'plan', '--json', *ends]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    modules = {line.rpartition('|')[2].strip() for line in done.stderr.splitlines()}
    assert not modules & {'numba', 'llvmlite', *HEAVY}
    assert all(line.startswith('import time:') for line in done.stderr.splitlines())
    assert main(['plan', '--json', *ends]) == 0
    answers = [json.loads(text) for text in (done.stdout, capsys.readouterr().out)]
    for answer in answers:
        for name in ('seconds_source', 'seconds_search'):
            del answer[name]
    assert answers[0] == answers[1]
