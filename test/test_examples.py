"""The scripts in examples/ are short, run, and print what they promise."""

import ast
import subprocess
import sys
from pathlib import Path

import pytest

SCRIPTS = sorted((Path(__file__).resolve().parents[1] / 'examples').glob('[1-9]_*.py'))
PROMISED = {
    '1_plan': 'times the shortest',
    '2_instruct': 'visit the charging bay: kept',
    '3_why': 'radius 2.0: NO_VALID_PATH',
    '4_plug_in': '(40, 5): accepted (75, 99): out_of_bounds',
    '5_robot_loop': 'at (75, 50) after',
}


@pytest.mark.parametrize('script', SCRIPTS, ids=lambda path: path.stem)
def test_an_example_runs_and_is_short(script):
    done = subprocess.run([sys.executable, script], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert PROMISED[script.stem] in done.stdout
    source = script.read_text()
    assert ast.get_docstring(ast.parse(source))
    assert len(source.splitlines()) <= 26


def test_there_are_five():
    assert [path.stem for path in SCRIPTS] == [*PROMISED]
