import functools
import threading
from dataclasses import replace

import pytest
from instruction_places import HOSPITAL
from llm_astar_msgs_adapter.maps.places import NO_PLACES
from llm_astar_planner.instructions.chain import (
    MAX_CALLBACKS,
    MAX_WAITING,
    BackgroundInterpreter,
    CachedInterpreter,
    ChainInterpreter,
    make_interpreter,
)
from llm_astar_planner.instructions.clauses.avoid import Avoid
from llm_astar_planner.instructions.clauses.unknown import Unknown
from llm_astar_planner.instructions.clauses.visit import Visit
from llm_astar_planner.instructions.interpretation import Interpretation, Understanding
from llm_astar_planner.instructions.regions import NamedPlace
from llm_astar_planner.instructions.specification import Specification
from llm_astar_planner.waypoints.config import SettingsError

KITCHEN = Avoid(region=NamedPlace('kitchen'))
LOBBY = Visit(regions=(NamedPlace('lobby'),))
PART = (KITCHEN, Unknown(text='and so on'))
LONG = 20.0


class Scripted:
    """An interpreter that gives one reading, after `gate` is set."""

    def __init__(self, name, status=Understanding.WHOLE, clauses=(KITCHEN,)):
        self.name = name
        self.status = status
        self.clauses = clauses
        self.asked = []
        self.gate = threading.Event()
        self.gate.set()
        self.began = threading.Semaphore(0)

    def interpret(self, text, places, time_limit):
        self.asked.append(text)
        self.began.release()
        assert self.gate.wait(LONG)
        return Interpretation(
            text, Specification(self.clauses), self.name, self.status, self.name, 1.0, 10, 5
        )


def partial(name='grammar', clauses=PART):
    return Scripted(name, Understanding.PARTLY, clauses)


def test_what_the_first_one_reads_whole_is_not_asked_of_the_second():
    first, second = Scripted('grammar'), Scripted('model')
    found = ChainInterpreter([first, second]).interpret('a', NO_PLACES, 1.0)
    assert found.understood_by == 'grammar'
    assert second.asked == []


def test_the_reader_is_asked_about_what_is_a_question_of_the_grammar_and_no_model_is():
    unsure = Scripted('grammar', Understanding.UNSURE, (replace(KITCHEN, unsure='?'),))
    reader, model = Scripted('reader'), Scripted('model')
    assert ChainInterpreter([unsure, reader, model]).interpret('a', NO_PLACES, 1.0).is_whole
    reader.status, reader.clauses = Understanding.NONE, ()
    found = ChainInterpreter([unsure, reader, model]).interpret('a', NO_PLACES, 1.0)
    assert (found.understood_by, found.status) == ('grammar', Understanding.UNSURE)
    assert model.asked == []


def test_the_second_is_asked_where_the_first_has_read_a_part():
    found = ChainInterpreter([partial(), Scripted('model')]).interpret('a', NO_PLACES, 1.0)
    assert (found.understood_by, found.seconds, found.prompt_tokens) == ('model', 2.0, 20)


def test_the_fuller_of_two_partial_readings_is_taken_and_the_first_of_equal_ones():
    more = partial('model', (KITCHEN, LOBBY, Unknown(text='x')))
    assert (
        ChainInterpreter([partial(), more]).interpret('a', NO_PLACES, 1.0).understood_by == 'model'
    )
    guessed = partial('model', (replace(KITCHEN, unsure='?'), Unknown(text='x')))
    found = ChainInterpreter([partial(), guessed]).interpret('a', NO_PLACES, 1.0)
    assert found.understood_by == 'grammar'
    assert found.detail == 'grammar; model'


def test_of_two_questions_the_model_is_asked_about_rather_than_the_reader():
    asked = (replace(KITCHEN, unsure='?'),)
    reader = Scripted('reader', Understanding.UNSURE, asked)
    model = Scripted('model', Understanding.UNSURE, asked)
    found = ChainInterpreter([reader, model]).interpret('a', NO_PLACES, 1.0)
    assert found.understood_by == 'model'


def test_a_sentence_is_paid_for_once_for_the_same_places():
    model = Scripted('model')
    chain = ChainInterpreter([partial(), model])
    chain.interpret('a', HOSPITAL, 1.0)
    again = chain.interpret('a', HOSPITAL, 1.0)
    assert model.asked == ['a']
    assert (again.seconds, again.prompt_tokens, again.understood_by) == (0.0, 0, 'model')
    chain.interpret('a', NO_PLACES, 1.0)
    chain.interpret('b', NO_PLACES, 1.0)
    assert model.asked == ['a', 'a', 'b']


@pytest.mark.parametrize('grammar', [partial(), Scripted('grammar', Understanding.NONE, ())])
def test_while_an_answer_is_missing_a_partial_reading_is_pending(grammar):
    model = Scripted('model', Understanding.PENDING, ())
    found = ChainInterpreter([grammar, model]).interpret('a', NO_PLACES, 1.0)
    assert found.status is Understanding.PENDING
    assert found.specification.clauses == grammar.clauses
    whole = ChainInterpreter([Scripted('grammar'), model]).interpret('a', NO_PLACES, 1.0)
    assert whole.status is Understanding.WHOLE


def test_a_missing_answer_is_asked_for_again_after_a_while(monkeypatch):
    model = Scripted('model', Understanding.PENDING, ())
    cached = CachedInterpreter(model)
    assert cached.interpret('a', NO_PLACES, 1.0).status is Understanding.PENDING
    cached.interpret('a', NO_PLACES, 1.0)
    assert model.asked == ['a']
    monkeypatch.setattr('llm_astar_planner.instructions.chain.FAILED_S', 0.0)
    cached.interpret('b', NO_PLACES, 1.0)
    cached.interpret('b', NO_PLACES, 1.0)
    assert model.asked == ['a', 'b', 'b']


def test_a_sentence_that_is_asked_twice_at_once_is_asked_of_the_model_once():
    model = Scripted('model')
    model.gate.clear()
    cached = CachedInterpreter(model)
    answers = []
    threads = [
        threading.Thread(
            target=lambda: answers.append(cached.interpret('a', NO_PLACES, LONG)), daemon=True
        )
        for _ in range(4)
    ]
    for thread in threads:
        thread.start()
    assert model.began.acquire(timeout=LONG)
    assert cached.interpret('a', NO_PLACES, 0.01).status is Understanding.PENDING
    model.gate.set()
    for thread in threads:
        thread.join(LONG)
    assert model.asked == ['a']
    assert [answer.understood_by for answer in answers] == ['model'] * 4


def test_an_interpreter_that_fails_has_understood_nothing():
    class Broken:
        name = 'broken'

        def interpret(self, text, places, time_limit):
            raise RuntimeError('no')

    found = ChainInterpreter([Broken(), Scripted('model')]).interpret('a', NO_PLACES, 1.0)
    assert found.understood_by == 'model'
    found = ChainInterpreter([Broken()]).interpret('a', NO_PLACES, 1.0)
    assert (found.status, found.detail) == (Understanding.NONE, 'RuntimeError in broken')


@pytest.fixture
def background():
    made = []

    def make(quick, slow):
        made.append(BackgroundInterpreter(quick, slow))
        return made[-1]

    yield make
    for interpreter in made:
        interpreter.close()


def test_the_quick_answer_comes_at_once_and_the_slow_one_by_a_call(background):
    slow = Scripted('model')
    slow.gate.clear()
    interpreter = background(partial(), slow)
    answers, done = [], threading.Event()

    def on_answer(interpretation):
        answers.append(interpretation)
        done.set()

    now = interpreter.interpret_now('a', NO_PLACES, on_answer)
    assert now.status is Understanding.PENDING
    assert now.specification.enforceable == (KITCHEN,)
    assert slow.began.acquire(timeout=LONG)
    assert interpreter.interpret_now('a', NO_PLACES).status is Understanding.PENDING
    slow.gate.set()
    assert done.wait(LONG)
    assert answers[0].understood_by == 'model'
    assert interpreter.interpret_now('a', NO_PLACES).status is Understanding.WHOLE
    assert slow.asked == ['a']


def test_a_whole_reading_is_not_asked_of_the_slow_one(background):
    slow = Scripted('model')
    interpreter = background(Scripted('grammar'), slow)
    assert interpreter.interpret_now('a', NO_PLACES).status is Understanding.WHOLE
    assert slow.asked == []


def test_the_newest_sentence_is_asked_first_and_the_oldest_of_too_many_dropped(background):
    slow = Scripted('model')
    slow.gate.clear()
    interpreter = background(partial(), slow)
    answers, details, done = [], [], threading.Semaphore(0)

    def on_answer(interpretation):
        answers.append((interpretation.text, interpretation.understood_by))
        details.append(interpretation.detail)
        done.release()

    interpreter.interpret_now('busy', NO_PLACES, on_answer)
    assert slow.began.acquire(timeout=LONG)
    for n in range(MAX_WAITING + 1):
        interpreter.interpret_now(str(n), NO_PLACES, on_answer)
    assert answers == [('0', 'grammar')]
    assert details == ['dropped, since newer questions came']
    slow.gate.set()
    for _ in range(MAX_WAITING + 2):
        assert done.acquire(timeout=LONG)
    assert slow.asked == ['busy', *(str(n) for n in range(MAX_WAITING, 0, -1))]


def test_of_too_many_callbacks_for_one_sentence_the_oldest_is_dropped(background):
    slow = Scripted('model')
    slow.gate.clear()
    interpreter = background(partial(), slow)
    answers, done = [], threading.Semaphore(0)

    def on_answer(number, interpretation):
        answers.append((number, interpretation.status))
        done.release()

    interpreter.interpret_now('busy', NO_PLACES)
    assert slow.began.acquire(timeout=LONG)
    for n in range(MAX_CALLBACKS + 1):
        interpreter.interpret_now('a', NO_PLACES, functools.partial(on_answer, n))
    assert answers == [(0, Understanding.PENDING)]
    slow.gate.set()
    for _ in range(MAX_CALLBACKS + 1):
        assert done.acquire(timeout=LONG)
    assert answers[1:] == [(n, Understanding.WHOLE) for n in range(1, MAX_CALLBACKS + 1)]


def test_a_model_that_did_not_answer_leaves_the_reading_pending(background):
    answers, done = [], threading.Event()

    def on_answer(interpretation):
        answers.append(interpretation)
        done.set()

    interpreter = background(partial(), Scripted('model', Understanding.PENDING, ()))
    interpreter.interpret_now('a', NO_PLACES, on_answer)
    assert done.wait(LONG)
    assert answers[0].status is Understanding.PENDING
    assert answers[0].specification.enforceable == (KITCHEN,)


def test_a_callback_that_fails_does_not_end_the_worker(background):
    slow = Scripted('model')
    interpreter = background(partial(), slow)
    done = threading.Event()
    interpreter.interpret_now('a', NO_PLACES, lambda _: 1 / 0)
    interpreter.interpret_now('b', NO_PLACES, lambda _: done.set())
    assert done.wait(LONG)


def test_another_slow_one_is_asked_what_waits_and_what_is_being_read(background):
    slow, other = Scripted('model'), Scripted('other')
    slow.gate.clear()
    quick = partial()
    interpreter = background(quick, slow)
    answers, done = [], threading.Semaphore(0)

    def on_answer(interpretation):
        answers.append((interpretation.text, interpretation.understood_by))
        done.release()

    interpreter.interpret_now('busy', NO_PLACES, on_answer)
    assert slow.began.acquire(timeout=LONG)
    interpreter.interpret_now('waits', NO_PLACES, on_answer)
    quick.gate.clear()
    reads = threading.Thread(
        target=interpreter.interpret_now, args=('is read', NO_PLACES, on_answer)
    )
    reads.start()
    assert all(quick.began.acquire(timeout=LONG) for _ in range(3))
    interpreter.ask(other)
    quick.gate.set()
    slow.gate.set()
    assert all(done.acquire(timeout=LONG) for _ in range(3))
    reads.join()
    assert sorted(answers) == [('busy', 'model'), ('is read', 'other'), ('waits', 'other')]


def test_a_closed_one_answers_by_the_quick_one_alone(background):
    interpreter = background(partial(), Scripted('model'))
    interpreter.close()
    assert interpreter.interpret_now('a', NO_PLACES).status is Understanding.PARTLY


def test_the_settings_of_a_source_make_the_chain(chat_server, tmp_path):
    names = [part.name for part in make_interpreter({'source': 'none'}).parts]
    assert names == ['grammar', 'reader']
    assert len(make_interpreter({}).parts) == 2
    chat_server.script = [
        chat_server.completion('{"clauses": [{"do": "visit", "where": "lobby"}]}')
    ]
    record = tmp_path / 'record.jsonl'
    values = {'source': 'endpoint', 'base_url': chat_server.base_url, 'record': str(record)}
    text = 'kindly pop your head round the door of the lobby'
    live = make_interpreter({**values, 'dataset': 'ignored'}).interpret(text, HOSPITAL, 10.0)
    assert LOBBY.regions == live.specification.clauses[0].regions
    replay = make_interpreter({'source': 'replay', 'transcript': str(record)})
    assert replay.interpret(text, HOSPITAL, 1.0).specification == live.specification
    with pytest.raises(SettingsError, match='base_url'):
        make_interpreter({'source': 'endpoint', 'base_url': 'ftp://x'})


def test_without_a_connection_the_grammar_s_reading_stays_and_the_reason_is_said():
    values = {'source': 'endpoint', 'base_url': 'http://127.0.0.1:1/v1', 'max_retries': 0}
    found = make_interpreter(values).interpret('gibber the jabber', HOSPITAL, 1.0)
    assert found.status is not Understanding.WHOLE
    assert 'UNREACHABLE' in found.detail
