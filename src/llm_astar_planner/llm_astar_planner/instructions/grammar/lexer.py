# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""From text to lexemes: places, nouns, vocabulary and numbers, the longest phrase first."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

from llm_astar_msgs_adapter.maps.places import Place

from llm_astar_planner.instructions.fields import FAR
from llm_astar_planner.instructions.grammar.lexemes import BEFORE_GOAL, Lexeme, composed, joined
from llm_astar_planner.instructions.grammar.lexicon import KIND, WALL, Group, Lexicon
from llm_astar_planner.instructions.grammar.selection import Modifier, Unclear, select_group
from llm_astar_planner.instructions.grammar.vocabulary import KINDS, Noun, Vocabulary, nouns
from llm_astar_planner.instructions.grammar.words import Word, errors_between, squeezed

# A word of a place or of the vocabulary is recognised with this many errors (letters left out,
# added, changed or exchanged) from this length on. In shorter words another word is too near:
# there only two exchanged letters and a doubled one count as an error.
SHORTEST = 4
LENGTHS = ((6, 1), (9, 2))
# How far a longer word, 'officer', may be from a name that it begins with.
LONGER = 5
SIGNS = {
    ',': 'COMMA', '-': 'COMMA', '\u2013': 'COMMA', '\u2014': 'COMMA', ':': 'COLON', '&': 'AND',
    ';': 'HARD', '.': 'HARD', '!': 'HARD', '?': 'HARD', '<': 'BELOW', '>': 'ABOVE',
}  # fmt: skip
# Misspelt words that are looked up in one sentence, so that none takes long.
MOST_CORRECTIONS = 6
# How many words a phrase takes, what it may mean (kinds and values), and whether it may mean
# something else: a synonym, or a word for a category.
Phrase = tuple[int, list[tuple[str, object]], bool]
NO_PHRASE: Phrase = (0, [], False)
Meaning = Sequence[tuple[str, str]]
# Letters of the longest side that begins a compound.
LONGEST_SIDE = 8


def corrections(word: str, known: Iterable[str]) -> list[str]:
    """Return the known words that a misspelt word may stand for, the nearest ones first."""
    if len(word) < SHORTEST:
        return []
    most = LENGTHS[-1][1]
    alike = (one for one in known if one[0] == word[0] and abs(len(one) - len(word)) <= most)
    near = sorted((errors_between(word, other), other) for other in alike)
    return [other for errors, other in near if errors <= most and is_misspelt(word, other, errors)]


def is_misspelt(word: str, other: str, distance: int) -> bool:
    """Whether a word may be another one with so many errors."""
    is_doubled = squeezed(word) == squeezed(other)
    if word.startswith(other) or other.startswith(word):
        return is_doubled or (distance == 1 and min(len(word), len(other)) >= LONGER)
    allowed = max((errors for length, errors in LENGTHS if len(other) >= length), default=0)
    # Two errors at the end are another word: 'pharmacist' is no pharmacy.
    if distance <= allowed and (distance == 1 or word[-1] == other[-1]):
        return True
    return is_doubled or (distance == 1 and sorted(word) == sorted(other))


@dataclass(frozen=True, eq=False)
class Lexer:
    """Reads instructions with the words of one language and of a map's places."""

    lexicon: Lexicon
    vocabulary: Vocabulary

    def lexemes(self, words: Sequence[Word]) -> list[Lexeme]:
        """Return the lexemes of words, without articles and filling words."""
        scanned: list[Lexeme] = []
        at = 0
        while at < len(words):
            count, found = self.scan(words, at)
            scanned += found
            at += count
        found = resolved(composed(scanned))
        ends = [one for one in scanned if one.kind == 'ENROUTE' and one.value != BEFORE_GOAL]
        return [*found, *ends[:1]]

    def scan(self, words: Sequence[Word], at: int) -> tuple[int, list[Lexeme]]:
        """Return how many words the longest phrase at a word takes, and its lexemes."""
        count, values, is_doubtful = max(self.place_phrases(words, at), key=lambda one: one[0])
        taken, meanings = self.vocabulary.phrases.longest(words, at)
        if taken > 1 and meanings[0][0][0] == 'OFMAP' and self.ends_with_place(words, at, taken):
            taken, meanings = self.vocabulary.phrases.longest(words[at : at + 1], 0)
        if taken > count:
            return taken, phrase_lexemes(words[at : at + taken], meanings)
        if count:
            place = self.place(words[at : at + count], values, is_doubtful)
            return count, [*self.preposition(words, at, count), place]
        return 1, self.compound(words[at]) or [self.single(words[at])]

    def ends_with_place(self, words: Sequence[Word], at: int, count: int) -> bool:
        """Whether a phrase for the map, 'of the hall', ends with a place of this map."""
        for first in range(at + 1, at + count):
            taken, values, _ = max(self.place_phrases(words, first), key=lambda one: one[0])
            value = values[0][1] if values else None
            # Every place is a 'place'.
            is_any = isinstance(value, Group) and value.noun == 'place'
            if taken >= at + count - first and not is_any:
                return True
        return False

    def place_phrases(self, words: Sequence[Word], at: int) -> list[Phrase]:
        """Return what a word may begin of names and nouns: the first of equal length counts."""
        lexicon = self.lexicon
        found = self.noun(words, at)
        if words[at].text not in lexicon.starts:
            return found or [NO_PHRASE]
        count, places = lexicon.names.longest(words, at)
        tagged, tags = lexicon.tag_groups.longest(words, at)
        near, variants = lexicon.near_names.longest(words, at)
        single, adjectives = lexicon.tags.longest(words, at)
        sure = {place.name for place, is_sure in variants if is_sure}
        near_places = dict.fromkeys(place for place, _ in variants)
        return [
            (count, [('PLACE', place) for place in places], False),
            (tagged, [('NOUN', self.tag_group(tag)) for tag in tags], False),
            *found,
            (near, [('PLACE', place) for place in near_places], not sure),
            (single, [('TAG', tag) for tag in adjectives], False),
        ]

    def preposition(self, words: Sequence[Word], at: int, count: int) -> list[Lexeme]:
        """Return 'through' before a name that begins with 'between': one drives between, too."""
        meanings = self.vocabulary.phrases.exactly([words[at].text])
        if count < 2 or not meanings or meanings[0][0][0] != 'BETWEEN':
            return []
        return [Lexeme('THROUGH', '', words[at].start, words[at].end)]

    def noun(self, words: Sequence[Word], at: int) -> list[Phrase]:
        """Return the places that a noun at a word may mean, if there are any on the map."""
        found: list[Phrase] = []
        for language in (self.vocabulary.language, 'en'):
            count, meant = nouns().by_language[language].longest(words, at)
            if count:
                text = spoken(words[at : at + count])
                group = merged([self.lexicon.group(noun, text) for noun in meant], meant)
                found += [] if group is None else [(count, [('NOUN', group)], not group.own)]
        return found

    def compound(self, word: Word) -> list[Lexeme]:
        """Return the lexemes of a German compound: 'Nordgang' is the northern aisle."""
        if self.vocabulary.language != 'de' or not word.is_letters:
            return []
        for cut in range(3, min(len(word.text) - 2, LONGEST_SIDE)):
            meanings = self.vocabulary.phrases.exactly([word.text[:cut]])
            found = self.noun([replace(word, text=word.text[cut:])], 0)
            if found and meanings and meanings[0][0][0] in ('SIDE', 'CENTER'):
                _, values, is_doubtful = found[0]
                side = phrase_lexemes([word], meanings)
                return [*side, self.place([word], values, is_doubtful)]
        return []

    def place(
        self, words: Sequence[Word], values: Sequence[tuple[str, object]], is_doubtful: bool
    ) -> Lexeme:
        """Return the lexeme of a phrase for places; several with one name are a group."""
        kind, value = values[0]
        if len(values) > 1:
            named = tuple(place for _, place in values if isinstance(place, Place))
            kind, value = 'NOUN', Group(spoken(words), self.lexicon.places, named, plural=False)
        is_asked = is_doubtful or any(word.is_corrected for word in words)
        doubts = ((said(words), ''),) if is_asked else ()
        return Lexeme(kind, value, words[0].start, words[-1].end, doubts=doubts)

    def tag_group(self, tag: str) -> Group:
        """Return the places of a kind or with a tag."""
        return Group(
            f'{tag} places', self.lexicon.places, self.lexicon.places.with_tag(tag), True, tag
        )

    def single(self, word: Word) -> Lexeme:
        """Return the lexeme of a word that is in no table of phrases."""
        doubts = ((word.said, word.text),) if word.is_corrected else ()
        return Lexeme(self.kind_of(word), word.text, word.start, word.end, doubts=doubts)

    def kind_of(self, word: Word) -> str:
        """Return the kind of a word that is in no table of phrases."""
        if word.is_number:
            # A point in a number may part thousands: '1.500', but not in English.
            units, _, decimals = word.text.lstrip('-').partition('.')
            may_be_thousands = len(decimals) == 3 and units != '0'
            is_clear = self.vocabulary.language == 'en' or not may_be_thousands
            return 'NUMBER' if is_clear and abs(float(word.text)) <= FAR else 'UNKNOWN'
        if word.text in SIGNS or not word.is_letters:
            return SIGNS.get(word.text, 'SIGN')
        articles = {
            'THIS': self.vocabulary.demonstratives,
            'ANY_ARTICLE': self.vocabulary.any_articles,
            'ARTICLE': self.vocabulary.articles,
        }
        return next((kind for kind, words in articles.items() if word.text in words), 'UNKNOWN')

    def knows(self, word: str) -> bool:
        """Whether a word is in any of the tables."""
        lexicon, by_language = self.lexicon, nouns().by_language
        tables = (
            lexicon.names, lexicon.near_names, lexicon.tags, lexicon.tag_groups,
            by_language[self.vocabulary.language], by_language['en'],
        )  # fmt: skip
        is_in_table = any(word in table.words for table in tables)
        return self.vocabulary.knows(word) or is_in_table or bool(self.compound(Word(word, 0, 0)))

    def corrected(self, words: Sequence[Word]) -> tuple[list[Word], list[str]]:
        """Return the words with misspelt ones corrected, and what to say of unclear ones."""
        notes: list[str] = []
        strange = [one for one in words if one.is_letters and not self.knows(one.text)]
        meant = {}
        for word in strange[:MOST_CORRECTIONS]:
            near = self.near(word.text)
            if len(near) > 1:
                notes.append(f'"{word.text}" may be {" or ".join(near)}')
            meant[word] = replace(word, text=near[0]) if len(near) == 1 else word
        return [meant.get(word, word) for word in words], notes

    def near(self, word: str) -> list[str]:
        """Return the words that a misspelt word may stand for; several are equally possible."""
        plain = word.replace('ae', 'a').replace('oe', 'o').replace('ue', 'u')
        if self.knows(plain):
            return [plain]
        called = nouns().by_language[self.vocabulary.language]
        tables = (self.lexicon.spellings, called.words, self.vocabulary.phrases.words)
        found = next(filter(None, (corrections(word, table) for table in tables)), [])
        stems = {other.removesuffix('s').removesuffix('e') for other in found}
        return found[:1] if len(stems) == 1 else found


def merged(groups: Sequence[Group], meant: Sequence[Noun]) -> Group | None:
    """Return the places of all meanings of a noun, None if the map has none of them."""
    is_wall = any(noun.name == WALL for noun in meant)
    own = '' if any(not group.own for group in groups if group.places) else groups[0].own
    places = tuple(dict.fromkeys(place for group in groups for place in group.places))
    if not groups or (not places and not is_wall):
        return None
    # A word that is the same in both numbers ('Zimmer') counts as singular.
    plural = all(group.plural for group in groups)
    noun = WALL if is_wall else groups[0].noun
    own = own or (KIND if is_wall else '')
    return Group(groups[0].words, groups[0].all_places, places, plural, '', noun, own)


def spoken(words: Sequence[Word]) -> str:
    """Return words as they are compared."""
    return ' '.join(word.text for word in words)


def said(words: Sequence[Word]) -> str:
    """Return words as they were written."""
    return ' '.join(word.said or word.text for word in words)


def phrase_lexemes(words: Sequence[Word], meanings: Sequence[Meaning]) -> list[Lexeme]:
    """Return the lexemes of a phrase of the vocabulary."""
    start, end = words[0].start, words[-1].end
    other = meanings[1][0] if len(meanings) > 1 else ('', '')
    wrong = [word for word in words if word.is_corrected]
    doubts = ((said(wrong), spoken(wrong)),) if wrong else ()
    text = spoken(words)
    return [
        Lexeme(kind, value or (text if kind in KINDS.left_out else ''), start, end, *other, doubts)
        for kind, value in meanings[0]
    ]


def resolved(lexemes: Sequence[Lexeme]) -> list[Lexeme]:
    """Return lexemes with 'the vertical wall' as the place, if the words before it tell which."""
    result: list[Lexeme] = []
    begin = 0
    for lexeme in lexemes:
        if lexeme.kind not in KINDS.adjectives and lexeme.kind != 'NOUN':
            begin = len(result) + 1
        result.append(lexeme)
        if lexeme.kind == 'NOUN' and isinstance(lexeme.value, Group) and begin < len(result) - 1:
            run = result[begin:]
            place = described_place(run)
            if place is not None:
                result[begin:] = [joined(run, 'PLACE', place)]
            begin = len(result)
    return result


def described_place(lexemes: Sequence[Lexeme]) -> Place | None:
    """Return the one place that adjectives and a noun mean, None if there may be several."""
    *adjectives, noun = lexemes
    if any(lexeme.kind in ('ANY', 'ALL', 'ORDINAL') for lexeme in adjectives):
        return None
    parts = [Modifier(lexeme.kind, lexeme.value) for lexeme in adjectives]
    try:
        places = select_group(noun.value, parts, ()).places
    except Unclear:
        return None
    return places[0] if len(places) == 1 else None
