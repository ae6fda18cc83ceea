"""The order in which a question is answered."""

import json
import threading
from unittest.mock import Mock

from llm_astar_planner.instructions.interpretation import Interpretation, Understanding
from llm_astar_planner.nodes.common.questions import QuestionServer
from std_msgs.msg import String


def test_what_another_thread_finds_at_once_is_said_after_what_is_known_now():
    workers = []

    def interpret(question, on_answer):
        found = Interpretation(question.text, status=Understanding.WHOLE)
        workers.append(threading.Thread(target=on_answer, args=(found,)))
        workers[0].start()
        # Unless it waits for its turn, it is done by then.
        workers[0].join(0.2)
        return Interpretation(question.text, status=Understanding.PENDING)

    entities = Mock()
    QuestionServer(entities, interpret).on_question(String(data='avoid the lab'))
    workers[0].join()
    said = [call.args[0].data for call in entities.publisher().publish.call_args_list]
    assert [json.loads(text)['status'] for text in said] == ['not understood yet', 'understood']
