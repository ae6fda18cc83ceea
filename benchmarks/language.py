"""How sentences of public corpora and of other people are read: `python -m benchmarks.language`.

Each is read by the whole chain (grammar, networks), planned on a map, and judged by its own
meaning, in the corpus's own format: LTL in CSV for Lang2LTL and the cleanup world, sentences with
tasks in JSON for HouseWorld, clauses in JSON for free sentences and the locked ones of
`test/language/written.json`. A table by kind of sentence, language and reader says how many can be
met, are met, are met and claimed, and which claims are false, with 95 % intervals.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from llm_astar_lab.analysis.statistics import wilson_interval
from llm_astar_planner.instructions.chain import make_interpreter

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / 'test'))
from language import corpora, free, mutations, written
from language.judge import Court, Driver, Verdict, judge, table

COLUMNS = ('group', 'sentences', 'can be met', 'met', 'met and claimed', 'claims', 'false claims')
# A kind of sentence, its language, its map, the text and what it may mean.
Case = tuple[str, str, Any, str, Any]


def of_corpus(world: Callable[[], Any], sentences: Callable[[], Any]) -> Iterator[Case]:
    """Yield the sentences of a public corpus, all in English."""
    for kind, text, truths in sentences():
        yield kind, 'en', world(), text, truths


def of_people(worlds: dict[str, Any], sentences: Iterator[free.Sentence]) -> Iterator[Case]:
    """Yield sentences with clauses, each on its map."""
    for one in sentences:
        kinds = sorted({clause['kind'] for truth in one.truths[:1] for clause in truth.clauses})
        kind = kinds[0] if len(kinds) == 1 else 'several kinds' if kinds else 'nothing'
        yield kind, one.language, worlds[one.map], one.text, one.truths


def mutated() -> Iterator[Case]:
    """Yield 2,000 made sentences with a twist."""
    for one in mutations.cases(2000):
        yield one.kind, one.language, mutations.WORLDS[one.language], one.text, one.truths


SETS: dict[str, Callable[[], Iterator[Case]]] = {
    'lang2ltl': lambda: of_corpus(corpora.rooms_world, corpora.lang2ltl),
    'cleanup': lambda: of_corpus(corpora.cleanup_world, corpora.cleanup),
    'houseworld': lambda: of_corpus(corpora.house_world, corpora.houseworld),
    'free': lambda: of_people(free.worlds(), free.sentences()),
    'locked': lambda: of_people(written.worlds(), written.sentences(written.LOCKED)),
    'mutated': mutated,
}


def verdicts(cases: Iterator[Case], every: int) -> Iterator[tuple[tuple[str, ...], Verdict]]:
    """Yield what each sentence is counted under, and its verdict; progress goes to stderr."""
    interpreter, places = make_interpreter({}), {}
    began = time.monotonic()
    for number, (kind, language, world, text, truths) in enumerate(cases):
        if number % every:
            continue
        if id(world) not in places:
            places[id(world)] = Driver(world), Court(world)
        found = judge(interpreter, places[id(world)][0], text, truths, places[id(world)][1])
        by = found.reading.interpretation.understood_by
        yield ('all', f'kind: {kind}', f'language: {language}', f'read by: {by}'), found
        if number % 100 == 0:
            sys.stderr.write(f'{number} sentences, {time.monotonic() - began:.0f} s\n')


def row(name: str, found: list[Verdict]) -> tuple[str, ...]:
    """Return a row of the table."""
    able = [one for one in found if one.can_be_met]
    claims = sum(one.claimed for one in found)
    counts = (
        (sum(one.met for one in able), len(able)),
        (sum(one.met and one.claimed for one in able), len(able)),
        (sum(one.is_false for one in found), claims),
    )
    met, claimed, false = (share(*one) for one in counts)
    return name, str(len(found)), str(len(able)), met, claimed, str(claims), false


def share(count: int, total: int) -> str:
    """Return a count with its share in per cent and the interval of that."""
    if not total:
        return str(count)
    value, low, high = (100.0 * end for end in wilson_interval(count, total))
    return f'{count} ({value:.1f} %, {low:.1f} to {high:.1f})'


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument('sets', nargs='*', metavar='SET', help=f'of {", ".join(SETS)}')
    parser.add_argument('--every', type=int, default=1, help='judge each Nth sentence alone')
    args = parser.parse_args()
    for name in args.sets or SETS:
        if name not in SETS:
            parser.error(f'there is no set {name!r}: choose of {", ".join(SETS)}')
        if name in ('lang2ltl', 'cleanup', 'houseworld') and corpora.folder() is None:
            sys.stderr.write(f'{name}: no folder corpora/ in LLM_ASTAR_INSTRUCTIONS, left out\n')
            continue
        groups: dict[str, list[Verdict]] = {}
        for labels, found in verdicts(SETS[name](), args.every):
            for label in labels:
                groups.setdefault(label, []).append(found)
        rows = [row(label, groups[label]) for label in sorted(groups)]
        sys.stdout.write(f'\n{name}\n\n{table(rows, COLUMNS)}\n')


if __name__ == '__main__':
    main()
