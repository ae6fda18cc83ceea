# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""Questions about instructions that a person has answered, remembered for each map."""

import fcntl
import json
import threading
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path

from llm_astar_msgs_adapter.errors import LlmAstarError
from llm_astar_msgs_adapter.files import read_json
from llm_astar_msgs_adapter.maps.places import Places

from llm_astar_planner.caches import Recent
from llm_astar_planner.instructions.clauses.clause import Clause
from llm_astar_planner.instructions.interpretation import Interpretation

# Answers that are remembered; the oldest are forgotten.
SIZE = 1024
# The map by the digest of its places, the canonical sentence of the clause, and the question.
Key = tuple[str, str, str]


class ConfirmationsError(LlmAstarError, ValueError):
    """A file of confirmations cannot be used; the message names it."""


class Confirmations:
    """Remembers answers to questions, and gives them where the same is asked again. Thread-safe.

    With a `path` they are kept in a JSON file, which is written after each answer.
    """

    def __init__(self, path: str | Path | None = None, size: int = SIZE) -> None:
        """Remember the last `size` answers. Raises ConfirmationsError for a file that is none."""
        self._path = None if path is None else Path(path)
        self._size = size
        self._lock = threading.Lock()
        self._known: Recent[Key, bool] = Recent(size)
        if self._path is not None and self._path.exists():
            self._known.update(load(self._path, size))

    def __len__(self) -> int:
        """Return the number of answers."""
        return len(self._known)

    def remember(self, interpretation: Interpretation, places: Places, answer: bool) -> None:
        """Remember one answer to all questions of an interpretation.

        Raises OSError, or ConfirmationsError where another program spoilt the file.
        """
        clauses = interpretation.specification.clauses
        new = {key_of(clause, places): answer for clause in clauses if clause.unsure}
        with self._lock:
            self._known.update(new)
            if self._path is not None:
                with alone(self._path):
                    if self._path.exists():  # what others have written since
                        self._known.update({**load(self._path, self._size), **new})
                    save(self._path, self._known)

    def applied(self, interpretation: Interpretation, places: Places) -> Interpretation:
        """Return an interpretation with what is answered already: sure, or not understood."""
        asked = [clause for clause in interpretation.specification.clauses if clause.unsure]
        with self._lock:
            known = {one.unsure: self._known.get(key_of(one, places)) for one in asked}
        answers = {question: answer for question, answer in known.items() if answer is not None}
        return interpretation.answered(answers) if answers else interpretation


@contextmanager
def alone(path: Path) -> Iterator[None]:
    """Keep other processes from writing a file of answers meanwhile. Raises OSError."""
    with path.with_name(f'{path.name}.lock').open('w', encoding='utf-8') as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        yield


def key_of(clause: Clause, places: Places) -> Key:
    """Return what an answer is remembered by."""
    return places.digest, clause.sentence(), clause.unsure


def load(path: Path, size: int) -> dict[Key, bool]:
    """Read a file of answers. Raises ConfirmationsError."""
    entries = read_json(path, ConfirmationsError)
    try:
        return {
            (str(digest), str(sentence), str(question)): bool(answer)
            for digest, sentence, question, answer in entries[-size:]
        }
    except (TypeError, ValueError) as error:
        raise ConfirmationsError(f'{path}: not a list of answers: {error}') from None


def save(path: Path, known: Mapping[Key, bool]) -> None:
    """Write a file of answers, whole or not at all. Raises OSError."""
    text = json.dumps([[*key, answer] for key, answer in known.items()], ensure_ascii=False)
    new = path.with_name(f'{path.name}.new')
    new.write_text(text, encoding='utf-8')
    new.replace(path)
