"""Retrieved examples, as a real HTTP server receives them, and what is known of a reply."""

import hashlib
import re

import pytest
from llm_astar_msgs_adapter.maps.barrier_map import (
    Barrier,
    BarrierMap,
    Sample,
    load_barrier_maps,
)
from llm_astar_msgs_adapter.maps.problem_maps import save_maps
from llm_astar_planner.costmap.costmap import Costmap
from llm_astar_planner.resources import find_file
from llm_astar_planner.waypoints.config import SourceSettings, make_source
from llm_astar_planner.waypoints.prompts.examples import ExamplesError
from llm_astar_planner.waypoints.source import WaypointQuery
from llm_astar_planner.waypoints.transcript import read_transcript

MAP = BarrierMap(0, (0, 51), (0, 31), (Barrier(10, 0, 25),), (Barrier(25, 10, 22),))
QUERY = WaypointQuery(Costmap(MAP.to_grid()), (5, 5), (20, 20))
PATH = ((5.0, 5.0), (26.0, 9.0), (20.0, 20.0))


def source_for(server, **settings):
    return make_source(
        SourceSettings(
            source='endpoint',
            base_url=server.base_url,
            model='tiny',
            **{'timeout_s': 20.0, **settings},
        )
    )


def test_a_recording_says_which_model_and_prompt_its_reply_is_of(chat_server, tmp_path):
    status, headers, body = chat_server.completion('Generated Path: [[5, 5], [20', 'length')
    chat_server.script = [(status, headers, body | {'system_fingerprint': 'fp_1\x1b' + 'x' * 500})]
    record = tmp_path / 't.jsonl'
    mine = tmp_path / 'mine.txt'
    mine.write_text('{start} {goal} {horizontal_barriers} {vertical_barriers}')
    source_for(chat_server, prompt=str(mine), record=str(record), temperature=0.5).waypoints(QUERY)
    (exchange,) = read_transcript(record)
    made = exchange.provenance
    assert (made.finish_reason, made.temperature, made.seed) == ('length', 0.5, None)
    assert made.model_digest.startswith('fp_1')
    assert len(made.model_digest) == 200
    assert made.prompt_digest == hashlib.sha256(mine.read_bytes()).hexdigest()


def starts_of(prompt):
    """The start points of a prompt's examples, its question left out."""
    return re.findall(r'Start Point: (\[\d+, \d+\])', prompt)[:-1]


def test_the_most_similar_samples_replace_the_examples(chat_server):
    maps = load_barrier_maps(find_file('samples_1000.json', 'maps'))
    query = WaypointQuery(Costmap(maps[4].to_grid()), *maps[4].samples[2][:2])
    source = source_for(chat_server, prompt='zero_shot', retrieved_examples=3)
    reply = source.waypoints(query)
    assert reply.prompt == 'zero_shot+retrieved_3'
    text = chat_server.requests[0]['messages'][0]['content']
    shown = starts_of(text)
    assert len(shown) == 3
    assert '[5, 5]' not in shown
    # None is of the query's own map, whose barriers stand in the question alone.
    question = text[text.rindex('Start Point') :]
    for barriers in re.findall(r'Barriers: \[\[.*', question):
        assert text.count(barriers) == 1
    again = source_for(chat_server, prompt='few_shot', retrieved_examples=3).waypoints(query)
    assert again.messages == reply.messages


def test_retrieved_examples_keep_to_the_tokens_of_a_prompt(chat_server):
    source = source_for(chat_server, retrieved_examples=40, max_prompt_tokens=600)
    source.waypoints(QUERY)
    few = len(starts_of(chat_server.requests[0]['messages'][0]['content']))
    assert 2 < few < 8


def test_examples_come_from_a_file_of_the_users(chat_server, tmp_path):
    path = tmp_path / 'mine.json'
    wall = BarrierMap(0, (0, 51), (0, 31), (), (Barrier(30, 3, 20),), (Sample((7, 7), (43, 8)),))
    save_maps([wall], path)
    source_for(chat_server, retrieved_examples=1, examples_file=str(path)).waypoints(QUERY)
    text = chat_server.requests[0]['messages'][0]['content']
    assert starts_of(text) == ['[7, 7]']
    assert 'Generated Path: [[7, 7], ' in text
    with pytest.raises(ExamplesError, match=r'mine\.json: samples: 1, where 2 to 100000'):
        source_for(chat_server, retrieved_examples=2, examples_file=str(path))
