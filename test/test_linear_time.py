"""What reads foreign text takes linear time, on the worst texts that its patterns allow.

The texts are made from the patterns: whatever a pattern repeats is repeated, between a text that
leads there and an end that does not match, so that a pattern which can match in several ways has
to try them all.
"""

import ast
import contextlib
import importlib
import pkgutil
import re
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from re import _constants as codes
from re import _parser as parser
from typing import Any, NamedTuple

import pytest
from llm_astar_planner.waypoints.prompts.reply_parser import MAX_REPLY_CHARS, parse_reply

SMALL, LARGE = MAX_REPLY_CHARS // 8, MAX_REPLY_CHARS
# What takes less is not compared: the clock is too coarse, and nobody waits for it.
SHORT = 0.1
ENDS = ('', 'x', ')', ']', ' x')


class Reader(NamedTuple):
    """A function that reads foreign text, and the module of its patterns."""

    read: Callable[[str], object]
    module: str


READERS = {
    'reply': Reader(parse_reply, 'llm_astar_planner.waypoints.prompts.reply_parser'),
}


def patterns_of(module: str) -> list[re.Pattern[str]]:
    values = vars(importlib.import_module(module)).values()
    return [value for value in values if isinstance(value, re.Pattern)]


def sample(tokens: Any) -> str:
    """Return a text that a parsed pattern, or nearly, matches; repeats as rarely as allowed."""
    return ''.join(sample_of(code, value) for code, value in tokens)


def sample_of(code: Any, value: Any) -> str:
    if code is codes.LITERAL:
        return chr(value)
    if code is codes.IN:
        return sample_of(*value[0])
    if code is codes.RANGE:
        return chr(value[0])
    if code is codes.CATEGORY:
        return {codes.CATEGORY_DIGIT: '1', codes.CATEGORY_SPACE: ' '}.get(value, 'a')
    if code is codes.SUBPATTERN:
        return sample(value[3])
    if code is codes.BRANCH:
        return sample(value[1][0])
    if code in (codes.MAX_REPEAT, codes.MIN_REPEAT):
        return sample(value[2]) * max(1, value[0])
    return 'a' if code in (codes.NOT_LITERAL, codes.NEGATE, codes.ANY) else ''


def repeats(tokens: Any, before: str = '') -> Iterator[tuple[str, str]]:
    """Yield, for every repetition of a parsed pattern, the text before it and its body."""
    for code, value in tokens:
        if code in (codes.MAX_REPEAT, codes.MIN_REPEAT):
            if value[1] > 1:
                yield before, sample(value[2])
            yield from repeats(value[2], before)
        elif code is codes.SUBPATTERN:
            yield from repeats(value[3], before)
        elif code is codes.BRANCH:
            for branch in value[1]:
                yield from repeats(branch, before)
        before += sample_of(code, value)


def worst_texts(pattern: re.Pattern[str]) -> Iterator[Callable[[int], str]]:
    """Yield functions that return a bad text of a length: one long run, and many short ones."""
    pumps = dict.fromkeys(repeats(parser.parse(pattern.pattern)))
    for before, body in pumps:
        for end in ENDS:
            yield lambda size, a=before, b=body, e=end: a + b * (size // len(b)) + e
            for length in (38, 190):
                unit = before + body * (length // len(body)) + end
                yield lambda size, unit=unit: unit * (size // len(unit) + 1)
    bodies = list(dict.fromkeys(body for _, body in pumps))
    for first in bodies:
        for second in bodies:
            # In brackets, which a reply is split at, and in vain, for want of an end.
            for unit in (f'[{first * 38},{second * 38}x]', f'[{",".join([first * 24] * 3)}x]'):
                yield lambda size, unit=unit: unit * (size // len(unit) + 1)


def seconds(read: Callable[[str], object], text: str) -> float:
    """Return the least CPU time of two readings; one that took no time is not repeated."""
    least = 1e9
    for _ in range(2):
        start = time.thread_time()
        read(text)
        least = min(least, time.thread_time() - start)
        if least < SHORT:
            break
    return least


@pytest.mark.parametrize('name', READERS)
def test_reading_takes_linear_time(name):
    reader = READERS[name]
    patterns = patterns_of(reader.module)
    assert patterns
    for pattern in patterns:
        for text_of in worst_texts(pattern):
            small = seconds(reader.read, text_of(SMALL)[:SMALL])
            assert small < 3 * SHORT, text_of(80)
            large = seconds(reader.read, text_of(LARGE)[:LARGE])
            assert large < max(10 * small, 3 * SHORT), text_of(80)


def modules_of(package: str) -> Iterator[Any]:
    """Import every module of a package, but for those whose libraries are not installed."""
    root = importlib.import_module(package)
    for found in pkgutil.walk_packages(root.__path__, f'{package}.'):
        if not found.name.endswith('__main__'):
            with contextlib.suppress(ImportError):
                yield importlib.import_module(found.name)


def calls_of(module: Any) -> Iterator[tuple[str, str, str]]:
    """Yield the calls of methods: the name before the dot, the method, the first text if any."""
    for node in ast.walk(ast.parse(Path(module.__file__).read_text(encoding='utf-8'))):
        if not (isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute)):
            continue
        if isinstance(node.func.value, ast.Name):
            first = node.args[0] if node.args else None
            text = first.value if isinstance(first, ast.Constant) else ''
            yield node.func.value.id, node.func.attr, str(text)


class Used(NamedTuple):
    """A pattern, and whether it is looked for anywhere in a text."""

    pattern: re.Pattern[str]
    is_searched: bool


def every_pattern() -> dict[str, Used]:
    """Return all patterns of the packages by where they are."""
    found: dict[str, Used] = {}
    for package in ('llm_astar_msgs_adapter', 'llm_astar_planner', 'llm_astar_lab'):
        for module in modules_of(package):
            values = vars(module).values()
            if not any(value is re or isinstance(value, re.Pattern) for value in values):
                continue  # its source need not be parsed
            calls = list(calls_of(module))
            for name, value in vars(module).items():
                methods = {method for owner, method, _ in calls if owner == name}
                if isinstance(value, re.Pattern) and methods:
                    is_searched = not methods <= {'fullmatch', 'match'}
                    found[f'{module.__name__}.{name}'] = Used(value, is_searched)
            for owner, method, text in calls:
                if owner == 're' and method != 'compile' and text:
                    is_searched = method not in ('fullmatch', 'match')
                    found[f'{module.__name__}: {text}'] = Used(re.compile(text), is_searched)
    return found


# What is applied to few characters alone may take more time; so many each.
BOUNDED = {
    # Of the name of a file.
    r'llm_astar_lab.bags.reading: (\d+)(?=\.)': 255,
    # Of a bracket group with a point.
    'llm_astar_planner.waypoints.prompts.reply_parser._OBJECT_X': 200,
    'llm_astar_planner.waypoints.prompts.reply_parser._OBJECT_Y': 200,
    # Of the text before a list of points.
    'llm_astar_planner.waypoints.prompts.reply_parser._PATH_LABEL': 80,
    'llm_astar_planner.waypoints.prompts.reply_parser._SELECTED': 40,
}
PATTERNS = every_pattern()


@pytest.mark.parametrize('name', PATTERNS)
def test_every_pattern_takes_linear_time_by_itself(name):
    (pattern, is_searched), most = PATTERNS[name], BOUNDED.get(name, LARGE // 2)

    def read(text: Any) -> None:
        if isinstance(pattern.pattern, bytes):
            text = text.encode('latin-1', 'replace')
        if is_searched:
            for _ in pattern.finditer(text):
                pass
        else:
            pattern.match(text)
            pattern.fullmatch(text)

    for text_of in worst_texts(pattern):
        small = seconds(read, text_of(most // 8)[: most // 8])
        assert small < SHORT, text_of(80)
        assert seconds(read, text_of(most)[:most]) < max(10 * small, SHORT), text_of(80)


def test_the_patterns_of_the_packages_are_found():
    assert len(PATTERNS) > 20
    assert BOUNDED.keys() <= PATTERNS.keys()
