"""What CONTRIBUTING.md says of the files that a change touches."""

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
ROW = re.compile(r'^\| (an? [\w ]+) \| `(\w+)` \| (.*) \|$', re.MULTILINE)
ROWS = ROW.findall((ROOT / 'CONTRIBUTING.md').read_text())
# In what words the files name the example, where that is not its name alone.
WORDS = {
    'watch': r"'watch'|llm-astar watch",
    'keep_distance': r'\bkeep_distance\b|\bKeepDistance\b',
}


def product_files():
    for package in sorted((ROOT / 'src').iterdir()):
        for path in sorted((package / package.name).rglob('*')):
            if path.suffix in ('.py', '.json', '.lark', '.yaml', '.j2', '.txt', '.js'):
                yield path.relative_to(package / package.name).as_posix(), path


def test_each_kind_of_change_has_a_row():
    kinds = {'a command', 'a parameter', 'a search method', 'a metric of a plan', 'a clause'}
    assert {kind for kind, *_ in ROWS} == kinds


@pytest.mark.parametrize(('kind', 'example', 'files'), ROWS, ids=lambda value: value[:20])
def test_the_files_of_a_kind_of_change_are_those_that_name_an_example(kind, example, files):
    pattern = re.compile(WORDS.get(example, rf'\b{example}\b'))
    named = [name for name, path in product_files() if pattern.search(path.read_text())]
    assert sorted(re.findall(r'`([^`]+)`', files)) == sorted(named), kind
