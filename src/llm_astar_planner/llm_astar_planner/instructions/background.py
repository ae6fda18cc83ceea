"""Understand in the background: the quick answer at once, the slow one when it is there."""

from __future__ import annotations

import logging
import threading
from collections import OrderedDict
from collections.abc import Callable
from dataclasses import replace

from llm_astar_msgs_adapter.maps.places import Places

from llm_astar_planner.instructions.chain import READ_WHOLE, CachedInterpreter, fullest
from llm_astar_planner.instructions.interpretation import (
    Interpretation,
    Interpreter,
    Understanding,
)

_LOG = logging.getLogger(__name__)
MAX_WAITING = 8
MAX_CALLBACKS = 32
DROPPED = 'dropped, since newer questions came'

Key = tuple[str, str]
Callback = Callable[[Interpretation], None]


class BackgroundInterpreter:
    """Returns the quick interpreter's answer at once, and calls back with the slow one's.

    One worker thread asks the slow interpreter, the newest sentence first. Of more than
    MAX_WAITING sentences the oldest is dropped, and of more than MAX_CALLBACKS callbacks for one
    sentence too: they get the quick answer, still PENDING. Close it when done. Thread-safe.
    """

    def __init__(self, quick: Interpreter, slow: Interpreter, time_limit: float = 120.0) -> None:
        """Start the worker. `time_limit` is the seconds that the slow one may take."""
        self.name = slow.name
        self._quick = CachedInterpreter(quick)
        self._slow = CachedInterpreter(slow)
        self._time_limit = time_limit
        self._changed = threading.Condition()
        self._waiting: OrderedDict[Key, tuple[Interpretation, Places, list[Callback]]] = (
            OrderedDict()
        )
        self._closed = False
        self._worker = threading.Thread(target=self._work, name='instructions', daemon=True)
        self._worker.start()

    def interpret_now(
        self, text: str, places: Places, on_answer: Callback | None = None
    ) -> Interpretation:
        """Return what is understood now; PENDING where the slow interpreter is asked as well.

        `on_answer` is then called, on another thread, with the final interpretation, or with
        what is PENDING still if the slow interpreter did not answer.
        """
        reading = self._quick.interpret(text, places, 0.0)
        if reading.status in READ_WHOLE:
            return reading
        known = self._slow.known(text, places)
        if known is not None and known.status is not Understanding.PENDING:
            return fullest([reading, known])
        with self._changed:
            if self._closed:
                return reading
            key = text, places.digest
            _, _, callbacks = self._waiting.pop(key, (reading, places, []))
            callbacks += [on_answer] if on_answer else []
            dropped = [(reading, callback) for callback in callbacks[:-MAX_CALLBACKS]]
            del callbacks[:-MAX_CALLBACKS]
            self._waiting[key] = reading, places, callbacks
            if len(self._waiting) > MAX_WAITING:
                dropped += self._drop_oldest()
            self._changed.notify()
        self._tell_dropped(dropped)
        return replace(reading, status=Understanding.PENDING)

    def close(self) -> None:
        """End the worker after the question that it is asking; the rest is dropped."""
        with self._changed:
            self._closed = True
            dropped = [one for _ in list(self._waiting) for one in self._drop_oldest()]
            self._changed.notify()
        self._tell_dropped(dropped)

    def _drop_oldest(self) -> list[tuple[Interpretation, Callback]]:
        _, (reading, _, callbacks) = self._waiting.popitem(last=False)
        return [(reading, callback) for callback in callbacks]

    def _tell_dropped(self, dropped: list[tuple[Interpretation, Callback]]) -> None:
        for reading, callback in dropped:
            status = Understanding.PENDING
            self._tell(callback, replace(reading, status=status, detail=DROPPED))

    def _work(self) -> None:
        while True:
            with self._changed:
                while not self._waiting and not self._closed:
                    self._changed.wait()
                if self._closed:
                    return
                _, (reading, places, callbacks) = self._waiting.popitem(last=True)
            answer = self._slow.interpret(reading.text, places, self._time_limit)
            for callback in callbacks:
                self._tell(callback, fullest([reading, answer]))

    def _tell(self, callback: Callback, interpretation: Interpretation) -> None:
        try:
            callback(interpretation)
        except Exception:  # noqa: BLE001 - a callback must not end the worker
            _LOG.exception('the callback of an instruction failed')
