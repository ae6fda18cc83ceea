"""The demo as a user runs it: one command, a plan, a picture, nothing left behind."""

import re
import subprocess
import sys

from llm_astar_lab.pictures import style
from PIL import Image, ImageColor


def demo(*arguments):
    command = [sys.executable, '-m', 'llm_astar_planner.cli.main', 'demo', *arguments]
    return subprocess.run(command, capture_output=True, text=True, timeout=120)


def test_the_demo_plans_draws_and_stops(tmp_path):
    picture = tmp_path / 'out' / 'demo.png'
    done = demo('--png', str(picture))
    assert done.returncode == 0, done.stderr
    assert done.stderr == ''
    assert '\npath found: ' in done.stdout
    assert 'accepted, from embedded: learned waypoint model' in done.stdout
    assert 'not an LLM' in done.stdout
    # A* expands 721 cells here, and LLM-A* without waypoints 439.
    assert int(re.search(r'(\d+) expansions', done.stdout)[1]) < 200
    assert 'stopped the nodes' in done.stdout
    with Image.open(picture) as image:
        colours = {colour for _, colour in image.convert('RGB').getcolors(1 << 20)}
    assert {ImageColor.getrgb(style.PATH), ImageColor.getrgb(style.EXPANDED)} <= colours


def test_the_demo_draws_the_other_pairs_too(tmp_path):
    done = demo('--pair', '2', '--png', str(tmp_path / 'demo.png'))
    assert done.returncode == 0, done.stderr
    assert 'waypoint 1' in done.stdout
    assert 'occupied' not in done.stdout
