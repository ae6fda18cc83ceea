"""Every reader of foreign files and texts, with whole files to be damaged; see `fuzzing`."""

from __future__ import annotations

import io
import json
import sys
from collections.abc import Callable
from contextlib import suppress
from functools import partial
from pathlib import Path

import numpy as np
import zstandard
from bag_makers import (
    answer_at,
    call_at,
    exchange_at,
    goal_at,
    map_at,
    plan_at,
    report_at,
    room,
    start_at,
    tf_at,
    write_bag,
)
from fuzzing import Reader, run
from llm_astar_lab.analysis.summary import compare_with_none, growth, summarise
from llm_astar_lab.bags.reading import Bag
from llm_astar_lab.bags.storage import Channel
from llm_astar_lab.bags.types import Decoder, barrier_map_text, define
from llm_astar_lab.evaluation.requests import (
    RequestReader,
    TopicSelection,
    describe,
)
from llm_astar_lab.instruct_bench.suite import load_suite
from llm_astar_lab.report.pages import costmap_of
from llm_astar_lab.results.folder import ResultsFolder, describe_run
from llm_astar_lab.results.row import Row
from llm_astar_msgs_adapter.errors import LlmAstarError
from llm_astar_msgs_adapter.maps.barrier_map import (
    BarrierMap,
    load_barrier_maps,
)
from llm_astar_msgs_adapter.maps.map_server import load_map
from llm_astar_msgs_adapter.maps.places import load_places, places_from_geojson
from llm_astar_msgs_adapter.maps.problem_maps import (
    format_kept_maps,
    load_grid_problem,
    load_kept_maps,
    save_maps,
)
from llm_astar_planner.costmap.zones import zones_from_text
from llm_astar_planner.instructions.messages import parse_answer, parse_question
from llm_astar_planner.instructions.model.interpreter import interpret_reply
from llm_astar_planner.instructions.specification import from_json
from llm_astar_planner.instructions.transcript import ModelCall, read_exchanges
from llm_astar_planner.planning.footprint import Footprint
from llm_astar_planner.planning.parameters import read_parameter_files
from llm_astar_planner.resources import find_file
from llm_astar_planner.waypoints.learned import read_weights
from llm_astar_planner.waypoints.llm.credentials import redact
from llm_astar_planner.waypoints.llm.protocol import HttpReply, read_completion
from llm_astar_planner.waypoints.llm.resilience import EndpointFailure
from llm_astar_planner.waypoints.prompts.examples import load_example_library
from llm_astar_planner.waypoints.prompts.reply_parser import parse_reply
from llm_astar_planner.waypoints.prompts.template import load_template, template_path
from llm_astar_planner.waypoints.transcript import TranscriptWriter, read_transcript
from PIL import Image

MAPS = Path(find_file('samples_1000.json', 'maps')).parent
FIELDS = 'image: {}\nmode: scale\nresolution: 0.05\norigin: [-1.0, 2, 0.5]\nnegate: 0\n' \
    'occupied_thresh: 0.65\nfree_thresh: 0.196\n'  # fmt: skip
BOARD = 'type octile\nheight 4\nwidth 6\nmap\n......\n.@@T..\n..G.S.\n......\n'
SCENARIOS = 'version 1\n0\tx.map\t6\t4\t0\t0\t5\t3\t6.2426\n1\tx.map\t6\t4\t0\t3\t5\t0\t5.8\n'
BARRIERS = barrier_map_text(BarrierMap(1, (0, 20), (0, 10)))
# Two bags, since most of the time goes into the definitions of message types.
GOALS = [
    ('/llm_astar/barrier_map', 0.9, BARRIERS), map_at(1.0, room()),
    tf_at(1.0, 'map', 'odom', (1.0, 0.0), '/tf_static'), start_at(1.1, (3, 3)),
    goal_at(2.0, (9, 4)), plan_at(2.1, [(3, 3), (9, 4)]), map_at(4.0, room(12, 9, (3, 3))),
]  # fmt: skip
CALLS = [
    map_at(1.0, room()), call_at(1.2, (2, 2), (8, 3)), answer_at(1.3, [(2, 2), (8, 3)]),
    report_at(1.4, 'NONE', [[5, 5, 'accepted']], 1.2),
    exchange_at(1.4, messages=[['user', 'x']], response='[[5, 5]]'),
]  # fmt: skip
PLACE = {'type': 'Feature', 'properties': {'name': 'lab', 'kind': 'room', 'aliases': ['study'],
         'tags': 'blue, big'}, 'geometry': {'type': 'Polygon', 'coordinates': [
             [[1, 1], [4, 1], [4, 3.5], [1, 3], [1, 1]]]}}  # fmt: skip
POINT = {'type': 'Feature', 'properties': {'frame': 'map', 'id': 3, 'metadata': {'name': 'dock'}},
         'geometry': {'type': 'Point', 'coordinates': [5.0, 2.0, 0.0]}}  # fmt: skip
ZONE = {**PLACE, 'id': 'z1', 'properties': {'cost': 60, 'name': 'wet', 'seconds': 30.0}}
CLAUSES = {'clauses': [
    {'kind': 'avoid', 'region': {'place': 'lab'}, 'margin': 0.5, 'strength': 'should'},
    {'kind': 'visit', 'regions': [{'tag': 'room'}, {'point': [1, 2], 'radius': 0.5}]},
    {'kind': 'before', 'first': 'lab', 'second': {'between': ['lab', 'dock']}, 'guessed': True},
    {'kind': 'pass', 'region': {'place': 'dock'}, 'side': 'left'},
    {'kind': 'stay_in', 'region': {'box': [None, 0, 20, 9.5]}, 'strength': 'must'},
    {'kind': 'keep_distance', 'from': 'walls', 'metres': 0.4},
    {'kind': 'end_at', 'region': {'half': 'north', 'of': 'lab'}}, {'kind': 'unknown', 'text': 'x'},
    {'kind': 'avoid', 'region': {'along': 'walls', 'width': 2}},
]}  # fmt: skip
ANSWER = {'clauses': [
    {'do': 'avoid', 'where': 'lab'}, {'do': 'visit', 'where': {'all': 'room'}},
    {'do': 'keep_distance', 'from': 'walls', 'metres': 0.5},
    {'do': 'stay_in', 'where': {'x_between': [3, 1]}},
    {'do': 'pass', 'where': 'dock', 'side': 'left'},
    {'do': 'avoid', 'where': {'box': [3, 1, 0, 5]}},
    {'do': 'before', 'first': 'lab', 'second': 'dock'},
]}  # fmt: skip
UNDERSTOOD = {'id': 'q1', 'text': 'avoid the lab', 'specification': CLAUSES, 'error': '',
              'status': 'understood', 'understood_by': 'tiny', 'detail': '', 'seconds': 0.3,
              'prompt_tokens': 4, 'output_tokens': 7}  # fmt: skip
REPLY = 'Thoughts: 1. go up.\n```json\n{"path": [[5, 5], {"x": 26, "y": 9}, [20, 20]]}\n```\n' \
        'Generated Path: [(5, 5), (26.5, 9), (20, 20)] # done'  # fmt: skip
COMPLETION = {'choices': [{'message': {'content': [{'type': 'text', 'text': 'Path: [[1, 2]]'}],
              'refusal': None}, 'finish_reason': 'stop'}],
              'usage': {'prompt_tokens': 12, 'completion_tokens': 5}}  # fmt: skip
WAYPOINT_LINE = {
    'map': 3, 'pair': '1,2->3,4', 'scale': 1, 'model': 'tiny', 'prompt': 'few_shot', 'unit': 2,
    'messages': [{'role': 'user', 'content': 'where to?'}], 'response': 'Path: [[1, 2]]',
    'prompt_tokens': 10, 'completion_tokens': 5, 'seconds': 0.25, 'status': 'OK',
}  # fmt: skip
INSTRUCTION_LINE = {'text': 'avoid the lab', 'places': 'ab12', 'model': 'tiny', 'seconds': 0.1,
                    'reply': json.dumps(ANSWER), 'prompt_tokens': 3,
                    'output_tokens': 4}  # fmt: skip
NAV2 = """\
/**:
  ros__parameters:
    use_sim_time: false
planner_node:
  ros__parameters:
    max_planning_time: 2.0
    footprint: "[[0.3, 0.2], [0.3, -0.2], [-0.3, -0.2], [-0.3, 0.2]]"
    source: embedded
    tolerance: 0.5
llm_client_node:
  ros__parameters: {source: openai, model: tiny, temperature: 0.0}
"""
SUITE = {'version': 1, 'maps': {'p50': {'places': {
    'lab': {'polygon': [[3, 3], [9, 3], [9, 8], [3, 8]], 'aliases': ['study'], 'tags': ['blue']},
    'dock': {'point': [20, 5], 'kind': 'object'}}}},
    'instructions': [{
        'id': 'a', 'map': 'p50', 'start': [1, 1], 'goal': [2, 20], 'text': 'avoid the lab',
        'spec': {'clauses': [{'kind': 'avoid', 'region': 'lab'}]}, 'tags': ['x'], 'accept': [],
        'checks': [
            {'check': 'inside_max', 'region': {'place': 'lab'}, 'metres': 0.5, 'clause': 0},
            {'check': 'touch', 'region': {'near': {'circle': [3, 3, 1]}, 'width': 2}, 'tol': 1},
            {'check': 'order', 'regions': [{'tag': 'blue'}, {'rect': [None, 0, 5, 5]}]},
            {'check': 'cross', 'segment': [0, 0, 5, 5], 'times': 'some'},
            {'check': 'length_max', 'of_direct': 2.0},
            {'check': 'end_in', 'region': {'union': [{'half': 'left'}, {'walls': 1.0}]}},
        ]}]}  # fmt: skip


def file(name: str, contents: str | bytes | object) -> Callable[[Path], Path]:
    """Return a maker of one file: text, bytes, or a value that is written as JSON."""

    def make(folder: Path) -> Path:
        path = folder / name
        text = contents if isinstance(contents, (str, bytes)) else json.dumps(contents)
        path.write_bytes(text if isinstance(text, bytes) else text.encode())
        return path

    return make


def text_reader(contents: object, read: Callable[[str], object]) -> Reader:
    """Return the reader of a text that stands in no file."""

    def read_text(path: Path) -> object:
        return read(path.read_bytes().decode(errors='surrogateescape'))

    return Reader(file('text', contents), read_text, of_files=False)


def collection(*features: object) -> dict[str, object]:
    return {'type': 'FeatureCollection', 'features': list(features)}


def make_bag(
    messages: list[tuple[str, float, object]], storage: str, ending: str
) -> Callable[[Path], Path]:
    def make(folder: Path) -> Path:
        return next(write_bag(folder / 'bag', messages, storage).glob(f'*{ending}'))

    return make


def make_packed_bag(folder: Path) -> Path:
    plain = make_bag(GOALS[1:2], 'mcap', '.mcap')(folder)
    packed = folder / 'x.mcap.zstd'
    packed.write_bytes(zstandard.ZstdCompressor().compress(plain.read_bytes()))
    return packed


def make_metadata(folder: Path) -> Path:
    return make_bag(GOALS[1:2], 'mcap', '.mcap')(folder).with_name('metadata.yaml')


def read_bag(path: Path) -> None:
    whole = path.parent if path.name == 'metadata.yaml' else path
    with Bag(whole) as bag:
        for _ in RequestReader(bag, TopicSelection(), 1.0).requests():
            pass
        describe(bag, TopicSelection())


def make_image(kind: str, **options: object) -> Callable[[Path], Path]:
    def make(folder: Path) -> Path:
        (folder / 'x.yaml').write_text(FIELDS.format(f'x.{kind}'))
        pixels = np.random.default_rng(1).integers(0, 256, (20, 30), dtype=np.uint8)
        image = Image.fromarray(pixels)
        (image.convert('LA') if options.pop('alpha', False) else image).save(
            folder / f'x.{kind}', **options
        )
        return folder / f'x.{kind}'

    return make


def make_map_yaml(folder: Path) -> Path:
    make_image('pgm')(folder)
    return folder / 'x.yaml'


def make_board(folder: Path) -> Path:
    (folder / 'x.map.scen').write_text(SCENARIOS)
    return file('x.map', BOARD)(folder)


def make_scenarios(folder: Path) -> Path:
    make_board(folder)
    return folder / 'x.map.scen'


def make_barriers(folder: Path) -> Path:
    save_maps(load_barrier_maps(MAPS / 'samples_1000.json')[:2], folder / 'x.json')
    return folder / 'x.json'


def make_results(name: str) -> Callable[[Path], Path]:
    def make(folder: Path) -> Path:
        results = ResultsFolder(folder)
        maps = load_barrier_maps(MAPS / 'samples_1000.json')[:1]
        row = Row(maps[0].id, 0, 1, 'astar', 'none', '', '', 'NONE', 90.0, 100.0, 30.5)
        guided = Row(maps[0].id, 0, 1, 'llm_astar', 'straight', '', '', 'NONE', 40.0, 50.0, 31.5,
                     waypoints='1,2;3,4', verdicts='accepted;occupied',
                     path='1,2;30,2')  # fmt: skip
        results.start()
        results.append([row, guided])
        described = describe_run(
            [MAPS / 'samples_1000.json'],
            {'seed': 0, 'rules': {'unknown_cost': 1}, 'weight': 1.5, 'max_suboptimality': None},
        )
        results.write_json('metadata.json', described)
        results.write_text('maps.json', format_kept_maps(maps))
        return folder / name

    return make


def make_parquet(folder: Path) -> Path:
    table = make_results('results.csv')(folder)
    part = folder / 'results.parquet' / 'part-000000.parquet'
    part.parent.mkdir()
    ResultsFolder(folder).stored().write(part)
    table.write_text(table.read_text().partition('\n')[0] + '\n')
    return part


def make_grid_problem(folder: Path) -> Path:
    board = load_grid_problem(make_scenarios(folder))
    return file('maps.json', format_kept_maps([board]))(folder)


def read_results(path: Path) -> None:
    folder = ResultsFolder(path.parent)
    metadata, rows = folder.read_metadata(), list(folder.read())
    seed = metadata['parameters'].get('seed', 0)
    costmap_of(metadata)
    summarise(rows, seed)
    compare_with_none(rows, seed)
    growth(rows)
    load_kept_maps(path.parent / 'maps.json')
    folder.read_places()


def make_weights(folder: Path) -> Path:
    held = io.BytesIO()
    header = np.frombuffer(b'{"format": 1, "layers": 1}', np.uint8)
    np.savez_compressed(held, header=header, **{'enter.weight': np.ones((4, 3), np.float16)})
    return file('weights.npz', held.getvalue())(folder)


def append_to_transcript(path: Path) -> None:
    TranscriptWriter(path)


def read_definition(text: str) -> None:
    decoder = Decoder()
    decoder.learn(Channel('/x', 'nav_msgs/msg/Path', text, 'ros2msg', 'cdr'))
    if decoder.knows('nav_msgs/msg/Path'):
        with suppress(LlmAstarError):
            decoder.decode('nav_msgs/msg/Path', bytes(100))


def read_specification(text: str) -> None:
    try:
        value = json.loads(text)
    except (ValueError, RecursionError):
        return
    from_json(value)


def read_instruction_reply(text: str) -> None:
    places = places_from_geojson(collection(PLACE, POINT), 'places')
    interpret_reply(ModelCall('avoid the lab within 3 m', places.digest, 'tiny', text), places)


def read_reply(text: str) -> None:
    found = parse_reply(text)
    assert found is None or np.isfinite(found).all()


def read_body(text: str) -> None:
    for status in (200, 400):
        with suppress(EndpointFailure):
            body = HttpReply(status, {}, text.encode(errors='replace'))
            read_completion(body, partial(redact, secret='k' * 16))


READERS: dict[str, Reader] = {
    'bag_mcap': Reader(make_bag(GOALS, 'mcap', '.mcap'), read_bag),
    'bag_sqlite3': Reader(make_bag(CALLS, 'sqlite3', '.db3'), read_bag),
    'bag_packed': Reader(make_packed_bag, read_bag),
    'bag_metadata': Reader(make_metadata, read_bag),
    'bag_definition_msg': text_reader(define('nav_msgs/msg/Path').text, read_definition),
    'map_yaml': Reader(make_map_yaml, load_map),
    'map_pgm': Reader(make_image('pgm'), lambda path: load_map(path.with_name('x.yaml'))),
    'map_png': Reader(
        make_image('png', alpha=True), lambda path: load_map(path.with_name('x.yaml'))
    ),
    'map_bmp': Reader(make_image('bmp'), lambda path: load_map(path.with_name('x.yaml'))),
    'map_jpeg': Reader(make_image('jpeg'), lambda path: load_map(path.with_name('x.yaml'))),
    'movingai_map': Reader(
        make_board, lambda path: load_grid_problem(path.with_name('x.map.scen'))
    ),
    'movingai_scenarios': Reader(make_scenarios, load_grid_problem),
    'barrier_maps': Reader(make_barriers, load_barrier_maps),
    'kept_maps': Reader(make_grid_problem, load_kept_maps),
    'places': Reader(file('places.geojson', collection(PLACE, POINT)), load_places),
    'zones': text_reader(collection(ZONE), lambda text: zones_from_text(text, 5.0)),
    'parameters': Reader(file('x.yaml', NAV2), lambda path: read_parameter_files([path])),
    'footprint': text_reader('[[0.3, 0.2], [0.3, -0.2], [-0.3, -0.2]]', Footprint.parse),
    'transcript': Reader(
        file('x.jsonl', '\n'.join([json.dumps(WAYPOINT_LINE)] * 3) + '\n'), read_transcript
    ),
    'transcript_of_instructions': Reader(
        file('x.jsonl', f'{json.dumps(INSTRUCTION_LINE)}\n{json.dumps(WAYPOINT_LINE)}'),
        read_exchanges,
    ),
    'transcript_to_append': Reader(
        file('x.jsonl', f'{json.dumps(INSTRUCTION_LINE)}\n{json.dumps(WAYPOINT_LINE)}'),
        append_to_transcript,
    ),
    'template': Reader(
        file('x.txt', template_path('cot').read_bytes()), lambda path: load_template(str(path))
    ),
    'solved_samples': Reader(
        make_barriers, lambda path: load_example_library(str(path), at_least=1)
    ),
    'weights': Reader(make_weights, lambda path: read_weights(path.read_bytes(), str(path))),
    'results_rows': Reader(make_results('results.csv'), read_results),
    'results_parquet': Reader(make_parquet, lambda path: read_results(path.parent)),
    'results_metadata': Reader(make_results('metadata.json'), read_results),
    'results_maps': Reader(make_results('maps.json'), read_results),
    'suite': Reader(file('suite.json', SUITE), load_suite),
    'specification': text_reader(CLAUSES, read_specification),
    'question': text_reader(
        {'text': 'avoid the lab', 'id': 'q', 'places': collection(PLACE)}, parse_question
    ),
    'answer': text_reader(UNDERSTOOD, parse_answer),
    'reply': text_reader(REPLY, read_reply),
    'reply_to_instruction': text_reader(ANSWER, read_instruction_reply),
    'completion': text_reader(COMPLETION, read_body),
}


if __name__ == '__main__':
    for found in run(READERS, dict(word.split('=') for word in sys.argv[1:])):
        sys.stdout.write(f'{json.dumps(found)}\n')
        sys.stdout.flush()
