"""Makes lifted sentences with their meanings from the phrases of each language.

A sentence is a list of tokens as `reader.lifting` makes them, its meaning a list of tokens of
`reader.meaning`. Regions are `@R1`, in the meaning `R1`; the trainer numbers them anew.
"""

from __future__ import annotations

import random
import re
from functools import cache
from pathlib import Path
from typing import Any

from llm_astar_planner.instructions.grammar.words import comparable
from llm_astar_planner.instructions.reader.meaning import CLAUSES, LISTS, NOTHING

Random = random.Random
Words = list[str]
# Words, and lists of alternatives which are trees themselves.
Tree = list[Any]
Filled = tuple[Words, Words]
FOLDER = Path(__file__).with_name('phrases')
LANGUAGES = ('en', 'en', 'en', 'de', 'fr', 'es')
TOKEN = re.compile(r'\{\w\}|[^\W\d_]+|\d+|[^\w\s]')
MACRO = re.compile(r'<(\w+)>')
# How a kind of region is drawn, and how often.
PLACES = ('@R', '@R', '@R', '@R', '@R', '@R', '@O', '@G')
# How often a kind of meaning is drawn; 1 for the others.
WEIGHTS = {
    'A a': 7, 'V a )': 7, 'V a ) V b )': 7, 'B a b': 4, 'V a ) A b': 2.5, 'A HF s': 2,
    'T a b': 4, 'N a b': 4, 'S a': 3, 'P a s': 3, 'K a n': 3, 'C a k': 3, 'E a': 2.5, 'A a A b': 3,
    'V a b )': 3, 'W A a': 3,
    'V a ) V b ) V c )': 3, 'A b V a )': 3, '': 4, NOTHING: 3, 'V a ) V b ) B a b': 2, 'V a b ) V c )': 1.5,
}  # fmt: skip
NEVER_JOINED = {'', NOTHING, 'S a'}
WISHED = ('A', 'V', 'S', 'K', 'P', 'B')


class Phrases:
    """The phrases of one language: sections of lines, and the lists of words in them."""

    def __init__(self, language: str) -> None:
        """Read them."""
        self.sections: dict[str, list[Tree]] = {}
        self.regions: dict[str, list[Tree]] = {}
        self.words: dict[str, list[Tree]] = {}
        lists: dict[str, str] = {}
        table: list[Tree] | None = None
        for line in (FOLDER / f'{language}.txt').read_text(encoding='utf-8').splitlines():
            if line.startswith('['):
                name = line[1:-1]
                if name.startswith('region '):
                    table = self.regions.setdefault(name[7:], [])
                elif name.islower() and ' ' not in name:
                    table = self.words.setdefault(name, [])
                else:
                    table = self.sections.setdefault(name, [])
            elif table is None and ' = ' in line and not line.startswith('#'):
                name, _, words = line.partition(' = ')
                lists[name] = words
            elif table is not None and line:
                table.append(parsed(MACRO.sub(lambda m: lists.get(m[1], m[0]), line)))
        self.nouns = [word for words in self.words.pop('nouns') for word in words]
        self.names = list(self.sections)
        self.weights = [WEIGHTS.get(name, 1) for name in self.names]


def parsed(line: str) -> Tree:
    """Return a line as a tree: a list of words and of lists of alternatives."""
    words: Tree = []
    stack: list[list[Tree]] = [[words]]
    current = words
    for part in re.findall(r'[(|)]|[^(|)]+', line):
        if part == '(':
            current = []
            stack.append([current])
        elif part == '|':
            current = []
            stack[-1].append(current)
        elif part == ')':
            choices = stack.pop()
            current = stack[-1][-1]
            current.append(choices)
        else:
            text = part.replace("'", ' ')
            current.extend(
                word if word[0] == '{' else comparable(word)
                for word in TOKEN.findall(re.sub(r'(?<=\w)-(?=\w)', ' ', text))
            )
    return words


def expanded(tree: Tree, draw: Random) -> Words:
    """Return the words of a tree with alternatives drawn."""
    found: Words = []
    for part in tree:
        if isinstance(part, str):
            found.append(part)
        else:
            found += expanded(draw.choice(part), draw)
    return found


@cache
def phrases(language: str) -> Phrases:
    """Return the phrases of a language, read once."""
    return Phrases(language)


class Sentence:
    """A sentence under construction: its regions and other slots, numbered as they come."""

    def __init__(self, language: str, draw: Random) -> None:
        """Begin one in a language."""
        self.phrases, self.draw = phrases(language), draw
        self.count = {'R': 0, 'L': 0, 'S': 0, 'K': 0}
        self.known: list[Filled] = []

    def slot(self, kind: str, shown: str) -> tuple[str, str]:
        """Return (token, its name in the meaning) of a new slot."""
        self.count[kind] = number = self.count[kind] % 9 + 1
        return f'{shown}{number}', f'{kind}{number}'

    def region(self, name: str, is_visit: bool = False) -> Filled:
        """Return the words of a region, and its meaning."""
        draw = self.draw
        chance = draw.random()
        if chance < 0.06:
            noun = draw.sample(self.phrases.nouns, draw.choice((1, 1, 2)))
            noun = [invented(draw)] if draw.random() < 0.3 else noun
            return [*self.article(), *noun], ['?']
        if chance < 0.15:
            return self.composed()
        if chance < 0.18 and self.known:
            return draw.choice(self.known)
        if name == 'g':
            shown = '@G'
        elif name == 'o':
            shown = '@O'
        else:
            shown = draw.choice(PLACES)
        token, meant = self.slot('R', shown)
        if shown == '@G':
            return self.group(token, meant, is_visit)
        found = [*self.article(), token], [meant]
        self.known.append(found)
        return found

    def group(self, token: str, meant: str, is_visit: bool) -> Filled:
        """Return the words for several places, all of them or any one, and the meaning."""
        draw, words = self.draw, self.phrases.words
        if not is_visit and draw.random() < 0.35:
            some = expanded(draw.choice((*words['any'], [], [])), draw)
            return [*some, token.replace('G', 'Y')], [meant]
        if not is_visit:
            return [*expanded(draw.choice((*words['every'], [], [])), draw), token], [meant]
        if draw.random() < 0.5:
            return [*expanded(draw.choice((*words['every'], [])), draw), token], ['EA', meant]
        if draw.random() < 0.3:
            return [*self.article(), token.replace('@G', '@Y')], [meant]
        return [*expanded(draw.choice(words['any']), draw), token], [meant]

    def composed(self) -> Filled:
        """Return the words and meaning of a region put together of others."""
        draw, table = self.draw, self.phrases.regions
        name = draw.choice(list(table))
        words = expanded(draw.choice(table[name]), draw)
        return self.filled(words, name.split())

    def article(self) -> Words:
        """Return an article or none."""
        if self.draw.random() < 0.2:
            return []
        return expanded(self.draw.choice(self.phrases.words['article']), self.draw)

    def filled(self, words: Words, meaning: Words) -> Filled:
        """Return words and meaning with slots put in for their variables."""
        values: dict[str, Filled] = {}
        is_visit = meaning[:1] == ['V']
        result: Words = []
        for word in words:
            if word[0] != '{':
                result.append(word)
                continue
            name = word[1]
            if name not in values:
                values[name] = self.value(name, meaning, is_visit)
            result += values[name][0]
        meant: Words = []
        for token in meaning:
            if len(token) == 1 and token.islower():
                if token not in values:
                    values[token] = [], ['?']
                meant += values[token][1]
            else:
                meant.append(token)
        return result, meant

    def value(self, name: str, meaning: Words, is_visit: bool) -> Filled:
        """Return words and meaning of one variable."""
        if name in 'nks':
            kind = {'n': 'L', 'k': 'K', 's': 'S'}[name]
            is_number = kind == 'K' and meaning[0] in ('CL', 'CG', 'CE')
            token, meant = self.slot(kind, '@N' if is_number else f'@{kind}')
            return [token], [meant]
        if name in 'xyz' or (name == 'g' and meaning[0] in ('EX', 'OR')):
            token, meant = self.slot('R', '@G' if name == 'g' else self.draw.choice(PLACES[:7]))
            return [*self.article(), token], [meant]
        return self.region(name, is_visit)

    def clause(self) -> tuple[Words, Words, str]:
        """Return the words and meaning of one section's line."""
        table = self.phrases
        name = self.draw.choices(table.names, table.weights)[0]
        words = expanded(self.draw.choice(table.sections[name]), self.draw)
        meaning = [f'U_{name[2:]}'] if name.startswith('U ') else name.split()
        return (*self.filled(words, meaning), name)


def invented(draw: Random) -> str:
    """Return a word that nobody knows, in place of the name of a place."""
    syllables = (f'{draw.choice("bcdfghklmnprstvz")}{draw.choice("aeiou")}' for _ in range(3))
    return ''.join(syllables) + draw.choice(('', 'n', 'r', 's', 't', 'um', 'erie', 'hall'))


def visits(meaning: Words) -> bool:
    """Return whether a meaning has visits, and nothing else."""
    return {token for token in meaning if token in CLAUSES} <= {'V', 'OR', 'EA'}


def made(draw: Random) -> Filled:
    """Return (tokens, meaning) of a random sentence."""
    sentence = Sentence(draw.choice(LANGUAGES), draw)
    words_of = sentence.phrases.words

    def some(name: str) -> Words:
        return expanded(draw.choice(words_of[name]), draw)

    words, meaning, name = sentence.clause()
    if 'W' not in meaning and meaning and meaning[0] in WISHED and draw.random() < 0.06:
        wish = some('wish')
        words = [*words, *wish] if wish[0] == ',' or draw.random() < 0.4 else [*wish, *words]
        meaning = wished(meaning)
    if draw.random() < 0.25:
        words = [*some('before'), *words]
    if draw.random() < 0.25:
        words = [*words, *some('after')]
    rounds = 0
    while draw.random() < 0.36 and rounds < 3 and len(words) < 40:
        rounds += 1
        more, meant, other = sentence.clause()
        if name in NEVER_JOINED and other in NEVER_JOINED:
            continue
        both_visit = 'V' in meaning and 'V' in meant
        if both_visit and not (visits(meaning) and visits(meant) and 'W' not in meaning + meant):
            continue
        if both_visit:
            words = [*words, *some('then'), *more]
        else:
            joint = some('join')
            words = [*words, *(joint if meaning and meant else ['.']), *more]
        meaning = [*meaning, *meant]
        if draw.random() < 0.15:
            words = [*words, *some('after')]
    if draw.random() < 0.5:
        words = [*words, draw.choice('..!')]
    return noisy(words, draw), demanded(meaning)


def demanded(meaning: Words) -> Words:
    """Return a meaning without 'nothing is asked' where something is."""
    return [token for token in meaning if token != NOTHING] or meaning[:1]


def wished(meaning: Words) -> Words:
    """Return a meaning with each clause as a wish."""
    found: Words = []
    at = 0
    while at < len(meaning):
        end = clause_end(meaning, at)
        found += ['W', *meaning[at:end]]
        at = end
    return found


def clause_end(meaning: Words, at: int) -> int:
    """Return where the part of a meaning ends that begins at a token."""
    if meaning[at] in LISTS:
        at += 1
        while meaning[at] != ')':
            at = clause_end(meaning, at)
        return at + 1
    end = at + 1
    for _ in CLAUSES.get(meaning[at], ''):
        end = clause_end(meaning, end)
    return end


def noisy(words: Words, draw: Random) -> Words:
    """Return words with some commas dropped, words misspelt, and sometimes one left out."""
    found: Words = []
    drops = draw.random() < 0.2
    for word in words:
        if drops and word == ',':
            continue
        if word.isalpha() and len(word) > 3 and draw.random() < 0.015:
            found.append(misspelt(word, draw))
        else:
            found.append(word)
    return found


def misspelt(word: str, draw: Random) -> str:
    """Return a word with one letter left out, doubled or exchanged."""
    at = draw.randrange(1, len(word) - 1)
    return draw.choice(
        (
            word[:at] + word[at + 1 :],
            word[:at] + word[at] + word[at:],
            word[:at] + word[at + 1] + word[at] + word[at + 2 :],
        )
    )


def vocabulary(with_nouns: bool = True) -> set[str]:
    """Return all words of the phrases, those that stand for unknown places too or not."""
    found: set[str] = set()

    def walk(tree: Tree) -> None:
        for part in tree:
            if isinstance(part, str):
                found.add(part)
            else:
                for choice in part:
                    walk(choice)

    for language in set(LANGUAGES):
        table = phrases(language)
        found |= set(table.nouns) if with_nouns else set()
        for group in (table.sections, table.regions, table.words):
            for lines in group.values():
                for line in lines:
                    walk(line)
    return {word for word in found if word.isalpha()}
