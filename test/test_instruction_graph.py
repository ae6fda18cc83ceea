"""Instructions and places in the live graph: set, previewed, understood by a model, driven."""

import contextlib
import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import rclpy
from graph_tools import GOAL, START, calling, set_parameter, spinning, wait_for
from llm_astar_msgs_adapter.maps.grid_map import Pose2D
from llm_astar_msgs_adapter.messages.fields import path_from_message
from llm_astar_planner.nodes.common.entities import LATCHED, RELIABLE, REPORTS
from llm_astar_planner.nodes.llm_client_node import LlmClientNode
from llm_astar_planner.nodes.map_node import MapNode
from llm_astar_planner.nodes.planner.planner_node import PlannerNode
from nav_msgs.msg import Path as PathMessage
from rclpy.parameter import Parameter
from rclpy.qos import QoSProfile
from std_msgs.msg import Bool, String
from visualization_msgs.msg import MarkerArray

SPACE = '/instructed'
LOGS = QoSProfile(depth=100)
PLACES = {
    'dock': [[40, 2], [47, 2], [47, 7], [40, 7]],
    'lab': [[11.5, 5.5], [18.5, 5.5], [18.5, 9.5], [11.5, 9.5]],
    'press': [[29, 15], [31, 15], [31, 17], [29, 17]],
}
ALIASES = {'dock': ['loading bay']}
# Past what the grammar reads, but the names stand in it.
FREE_WORDING = 'visit the dock and regard the lab as a hornets nest'
REPLY = '{"clauses": [{"do": "visit", "where": "dock"}, {"do": "avoid", "where": "lab"}]}'


@pytest.fixture(scope='module')
def places_file(tmp_path_factory):
    """A file with the places of the demo map."""
    features = [
        {
            'type': 'Feature',
            'geometry': {'type': 'Polygon', 'coordinates': [[*corners, corners[0]]]},
            'properties': {
                'name': name,
                'kind': 'object' if name == 'press' else 'area',
                'aliases': ALIASES.get(name, []),
            },
        }
        for name, corners in PLACES.items()
    ]
    path = tmp_path_factory.mktemp('places') / 'places.geojson'
    path.write_text(json.dumps({'type': 'FeatureCollection', 'features': features}))
    return str(path)


@pytest.fixture(scope='module')
def nodes(places_file):
    """The three nodes in this process, and a caller of them."""
    rclpy.init()
    planner = PlannerNode(
        namespace=SPACE,
        parameter_overrides=[
            Parameter('use_waypoints', value=False),
            Parameter('places_file', value=places_file),
        ],
    )
    given = {'source': 'none', 'fixed_endpoint': False}
    client = LlmClientNode(
        namespace=SPACE,
        parameter_overrides=[Parameter(name, value=value) for name, value in given.items()],
    )
    with spinning(MapNode(namespace=SPACE), client, planner), calling(SPACE) as caller:
        caller.wait_until_ready(client='llm_client_node')
        yield Graph(caller, client, planner)
    rclpy.try_shutdown()


@pytest.fixture
def graph(nodes):
    """The graph, without an instruction before and after."""
    nodes.planner.set_parameters([Parameter('instruction', value='')])
    yield nodes
    nodes.planner.set_parameters([Parameter('instruction', value='')])


class Graph:
    """What the tests do to the graph."""

    def __init__(self, caller, client, planner):
        self.caller, self.client, self.planner = caller, client, planner
        self.publishers = {}
        self.heard = {'planner_node': [], 'llm_client_node': []}
        for node, answers in self.heard.items():
            take = self.taker(answers)
            caller.listen(String, f'{node}/interpretation', take, REPORTS)

    @staticmethod
    def taker(answers):
        def take(message):
            with contextlib.suppress(ValueError):
                answers.append(json.loads(message.data))

        return take

    def publish(self, topic, data, qos=RELIABLE, kind=String):
        if topic not in self.publishers:
            publisher = self.caller.node.create_publisher(kind, topic, qos)
            self.publishers[topic] = publisher
            wait_for(publisher.get_subscription_count, topic)
        self.publishers[topic].publish(kind(data=data))

    def ask(self, id_, text='', node='planner_node', **fields):
        """Ask what a text means; return the list that the answers come into."""
        self.publish(f'{node}/interpret', json.dumps({'text': text, 'id': id_, **fields}))
        wait_for(lambda: self.answers(id_, node), f'the answer to {text!r}')

    def answers(self, id_, node='planner_node'):
        return [answer for answer in list(self.heard[node]) if answer.get('id') == id_]

    def instruct(self, text):
        assert set_parameter(self.caller, 'planner_node', 'instruction', text).successful

    def interpretation(self):
        instruction = self.planner._server._instructions.current.instruction
        return instruction.interpretation if instruction else None

    def parameters(self, **values):
        for name, value in values.items():
            assert set_parameter(self.caller, 'planner_node', name, value).successful

    def parameter(self, name):
        return self.planner.get_parameter(name).value

    def outcomes(self, report):
        clauses = report.instruction_report['clauses']
        return {clause['clause']: clause['status'] for clause in clauses}


def is_in_dock(points):
    """Tell whether any of the points [n, 2] lies in the dock."""
    return ((points >= (40, 2)) & (points <= (47, 7))).all(axis=1).any()


def use_model(graph, server):
    """Let the client ask a scripted endpoint, and the planner know of it."""
    values = {'source': 'endpoint', 'base_url': server.base_url, 'model': 'tiny'}
    parameters = [Parameter(name, value=value) for name, value in values.items()]
    assert graph.client.set_parameters_atomically(parameters).successful


def test_a_question_about_the_last_plan_is_answered_in_its_language(graph):
    graph.caller.call(START, GOAL)
    graph.ask('why', 'Warum nicht durch das dock?')
    wait_for(lambda: len(graph.answers('why')) == 2, 'the answer')
    first, last = graph.answers('why')
    assert (first['status'], last['status']) == ('not understood yet', 'nothing about the route')
    assert last['understood_by'] == 'planner'
    assert last['detail'].startswith('durch das dock: ')
    assert ' statt ' in last['detail']
    graph.ask('what', 'why not through the ballroom?')
    wait_for(lambda: len(graph.answers('what')) == 2, 'the answer')
    assert 'is not understood' in graph.answers('what')[1]['detail']


def test_ways_to_choose_from_are_published_in_the_order_of_the_report(graph):
    ways = []
    graph.caller.listen(PathMessage, 'planner_node/alternatives', ways.append, RELIABLE)
    graph.parameters(alternatives=2)
    try:
        _, report, _ = graph.caller.call(START, GOAL)
        wait_for(lambda: len(ways) == 2, 'both ways')
    finally:
        graph.parameters(alternatives=0)
    for way, said in zip(ways, report.alternatives):
        length = np.hypot(*np.diff(path_from_message(way), axis=0).T).sum()
        assert length == pytest.approx(said['length'], abs=0.01)


def test_a_goal_in_a_wall_gets_a_partial_path_where_that_is_allowed(graph):
    wall = Pose2D(27.0, 15.0)
    _, refused, _ = graph.caller.call(START, wall)
    assert refused.why['causes'] == [{'kind': 'walls', 'holds': 'goal'}]
    assert refused.why['sentence'] in refused.message
    graph.parameters(allow_partial_planning=True)
    try:
        path, report, _ = graph.caller.call(START, wall)
    finally:
        graph.parameters(allow_partial_planning=False)
    assert (report.code, report.partial, report.why) == (0, True, refused.why)
    assert path_from_message(path)[-1].tolist() == report.why['nearest']


def test_an_instruction_from_the_topic_is_understood_enforced_and_verified(graph):
    graph.publish('planner_node/instruction', 'avoid the lab; visit the loading bay')
    wait_for(graph.interpretation, 'the interpretation')
    path, report, _ = graph.caller.call(START, GOAL)
    assert graph.outcomes(report) == {'avoid the lab': 'kept', 'visit the dock': 'kept'}
    points = path_from_message(path)
    inside = ((points >= (11.5, 5.5)) & (points <= (18.5, 9.5))).all(axis=1)
    assert not inside.any()
    assert is_in_dock(points)
    graph.publish('planner_node/instruction', '')
    wait_for(lambda: graph.interpretation() is None, 'no instruction')
    assert graph.caller.call(START, GOAL)[1].instruction == ''


def test_an_instruction_from_the_parameter_is_refused_if_it_is_too_long(graph):
    graph.instruct('avoid the lab')
    refused = set_parameter(graph.caller, 'planner_node', 'instruction', 'x' * 501)
    assert not refused.successful
    assert '501 characters are more than 500' in refused.reason
    assert graph.interpretation().sentence == 'avoid the lab'


def test_a_preview_says_what_a_text_means_and_sets_nothing(graph):
    graph.ask('preview', 'avoid the lab')
    (answer,) = graph.answers('preview')
    assert answer['question'] == 'avoid the lab'
    assert (answer['status'], answer['sentence']) == ('understood', 'avoid the lab')
    assert answer['specification']['clauses'][0]['region'] == {'place': 'lab'}
    assert answer['understood_by'] == 'grammar'
    assert graph.interpretation() is None
    graph.publish('planner_node/interpret', 'visit the dock')
    wait_for(lambda: graph.answers('')[-1:], 'the answer to a plain text')
    assert graph.answers('')[-1]['sentence'] == 'visit the dock'


def test_a_preview_is_answered_again_when_the_model_has_answered(graph, chat_server):
    chat_server.script = [chat_server.wait(0.5, chat_server.completion(REPLY))]
    use_model(graph, chat_server)
    text = f'{FREE_WORDING}, thanks'
    graph.ask('slow', text)
    wait_for(lambda: len(graph.answers('slow')) == 2, 'the second answer')
    first, second = graph.answers('slow')
    assert (first['status'], second['status']) == ('not understood yet', 'unsure')
    assert second['sentence'] == 'visit the dock; avoid the lab'


def test_a_model_is_asked_in_the_background_and_its_answer_is_used(graph, chat_server):
    chat_server.script = [chat_server.wait(1.0, chat_server.completion(REPLY))]
    use_model(graph, chat_server)
    graph.instruct(FREE_WORDING)
    report = graph.caller.call(START, GOAL)[1]
    assert report.code == 0
    assert report.instruction_report['interpretation']['status'] == 'not understood yet'
    wait_for(lambda: graph.interpretation().status.name == 'UNSURE', 'the model')
    report = graph.caller.call(START, GOAL)[1]
    assert graph.outcomes(report) == {'visit the dock': 'kept', 'avoid the lab': 'unsure'}
    graph.publish('planner_node/confirm', data=True, kind=Bool)
    wait_for(lambda: graph.interpretation().status.name == 'WHOLE', 'the confirmation')
    report = graph.caller.call(START, GOAL)[1]
    assert graph.outcomes(report) == {'visit the dock': 'kept', 'avoid the lab': 'kept'}
    assert report.instruction_report['interpretation']['understood_by'] == 'tiny'
    graph.ask('again', FREE_WORDING)
    assert graph.answers('again')[0]['status'] == 'understood'
    assert len(chat_server.requests) == 1


def test_the_client_answers_by_itself_with_the_places_of_the_question(graph):
    polygon = {'type': 'Polygon', 'coordinates': [[[0, 0], [5, 0], [5, 5], [0, 0]]]}
    feature = {'type': 'Feature', 'geometry': polygon, 'properties': {'name': 'kitchen'}}
    collection = {'type': 'FeatureCollection', 'features': [feature]}
    graph.ask('client', 'avoid the kitchen', node='llm_client_node', places=collection)
    (answer,) = graph.answers('client', 'llm_client_node')
    assert answer['sentence'] == 'avoid the kitchen'
    feature['geometry'] = {'type': 'Blob'}
    graph.ask('bad', 'avoid the kitchen', node='llm_client_node', places=collection)
    (answer,) = graph.answers('bad', 'llm_client_node')
    assert answer['error'].startswith("places: feature 0 ('kitchen'): geometry: 'Blob'")


@pytest.mark.parametrize('node', ['planner_node', 'llm_client_node'])
def test_hostile_questions_are_answered_with_an_error(graph, node):
    heard = graph.heard[node]
    for number, data in enumerate(
        [
            '{"text": ',
            '{"text": 5, "id": "h"}',
            '{"id": 5, "text": "x"}',
            '{"text": "x", "places": [], "id": "h"}',
            '{' + '"a":[' * 20_000,
            json.dumps({'text': 'x' * 501, 'id': 'h'}),
            'x' * 70_000,
        ]
    ):
        heard.clear()
        graph.publish(f'{node}/interpret', data)
        wait_for(lambda: heard, f'the answer to number {number}')
        assert heard[-1]['error'], data[:50]
        assert len(heard[-1]['question']) <= 1000
    # What nobody asked for is ignored.
    graph.publish('llm_client_node/interpretation', '{"id": "nobody", "status": [', REPORTS)
    for _ in range(200):
        graph.publish(f'{node}/interpret', 'avoid the lab; flummox the sprocket')
    graph.ask('after', 'avoid the lab', node=node)
    assert 'avoid the lab' in json.dumps(graph.answers('after', node)[0])
    assert graph.caller.call(START, GOAL)[1].code == 0


def test_what_was_visited_on_the_way_is_not_visited_again(graph):
    graph.instruct('visit the dock')
    path = path_from_message(graph.caller.call(START, GOAL)[0])
    at_dock = int(((path - (43.5, 4.5)) ** 2).sum(axis=1).argmin())

    def replan(point):
        path, report, _ = graph.caller.call(Pose2D(*point), GOAL)
        assert graph.outcomes(report) == {'visit the dock': 'kept'}
        return path_from_message(path)

    assert is_in_dock(replan(path[at_dock // 2]))
    for point in path[at_dock // 2 : -8 : 2]:
        replan(point)
    assert not is_in_dock(replan(path[-8]))
    # Elsewhere than the path leads is a new drive.
    assert is_in_dock(replan((30.0, 5.0)))


def test_the_last_path_is_replanned_when_the_instruction_changes_if_maps_do_so(graph):
    assert set_parameter(graph.caller, 'planner_node', 'replan_on_map', value=True).successful
    try:
        graph.caller.call(START, GOAL)
        paths = []
        graph.caller.listen(PathMessage, 'plan', paths.append, RELIABLE)
        graph.instruct('visit the dock')
        wait_for(lambda: any(is_in_dock(path_from_message(path)) for path in paths), 'a replan')
    finally:
        set_parameter(graph.caller, 'planner_node', 'replan_on_map', value=False)


def command(*arguments):
    """Start `llm-astar call` as a process of its own."""
    words = [sys.executable, '-m', 'llm_astar_planner.cli.main', 'call', *arguments]
    return subprocess.Popen(words, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)


def ended(process):
    """Return the exit code, the output and the errors of a process that ends."""
    output, errors = process.communicate(timeout=60.0)
    return process.returncode, output, errors


def test_the_call_command_asks_a_running_planner(graph):
    here = ['--namespace', SPACE, '--start', '39', '18']
    preview = command('--namespace', SPACE, '--interpret', 'avoid the lab', '--json')
    unknown = command(*here, '--to', 'ballroom')
    nobody = command('--namespace', '/nobody', '--interpret', 'x', '--time-limit', '1')
    code, output, _ = ended(preview)
    assert code == 0
    assert json.loads(output)['sentence'] == 'avoid the lab'
    code, _, errors = ended(unknown)
    assert code == 2
    assert "there is no place 'ballroom'; there is dock, lab, press" in errors
    code, _, errors = ended(nobody)
    assert code == 2
    assert 'is nobody/planner_node running?' in errors
    assert graph.interpretation() is None
    code, output, errors = ended(
        command(*here, '--to', 'press', '--instruction', 'visit the dock')
    )
    assert code == 0, errors
    assert output.startswith('path found: ')
    assert '\nstart      (39, 18) m\n' in output
    said = 'instruction "visit the dock"\nunderstood as: visit the dock\nunderstood by grammar\n'
    assert f'{said}clause 1   visit the dock: kept (' in output
    assert graph.interpretation().sentence == 'visit the dock'


def test_a_call_that_fails_leaves_no_instruction(graph):
    here = ['--namespace', SPACE, '--start', '39', '18', '--instruction', 'visit the dock']
    code, _, errors = ended(command(*here, '--to', 'ballroom'))
    assert code == 2, errors
    assert graph.parameter('instruction') == ''
    # A wall.
    code, output, _ = ended(command(*here, '--goal', '0', '0'))
    assert code == 1, output
    assert graph.parameter('instruction') == ''
    assert graph.interpretation() is None


def test_a_call_whose_instruction_is_not_kept_ends_with_3(graph):
    words = ['--from', 'lab', '--to', '7,19', '--instruction', 'avoid the lab', '--json']
    code, output, errors = ended(command('--namespace', SPACE, *words))
    assert code == 3, errors
    report = json.loads(output)['report']
    assert report['instruction_report']['satisfied'] is False
    assert graph.parameter('instruction') == 'avoid the lab'


def test_a_question_is_answered_on_the_topic_and_by_call(graph):
    question = 'Did you mean the dock by "dokc"?'
    here = ['--namespace', SPACE, '--start', '39', '18', '--goal', '7', '19', '--json']
    words = (*here, '--instruction', 'visit the dokc')
    code, output, errors = ended(command(*words))
    assert code == 3, errors
    interpretation = json.loads(output)['report']['instruction_report']['interpretation']
    assert interpretation['questions'] == [question]
    graph.ask('asked', 'visit the dokc')
    assert graph.answers('asked')[0]['questions'] == [question]
    assert 'add --confirm' in errors
    preview = command('--namespace', SPACE, '--interpret', 'visit the dokc')
    assert ended(preview)[1] == f'unsure by grammar: visit the dock; {question}\n'
    # The instruction is set.
    code, output, errors = ended(command(*here, '--confirm'))
    assert code == 0, errors
    # It is remembered, and another reading is another question.
    graph.instruct('visit the dokc')
    assert graph.interpretation().status.name == 'WHOLE'
    graph.instruct('avoid the dokc')
    assert graph.interpretation().status.name == 'UNSURE'
    graph.publish('planner_node/confirm', data=False, kind=Bool)
    wait_for(lambda: graph.interpretation().status.name == 'NONE', 'the answer')


def test_an_unsure_reading_is_no_path_under_the_policy_require(graph):
    assert set_parameter(graph.caller, 'planner_node', 'instruction_policy', 'require').successful
    try:
        graph.instruct('visit the loding bay')
        report = graph.caller.call(START, GOAL)[1]
        assert report.code_name == 'NO_VALID_PATH'
        assert 'by "loding bay"?' in report.message
        graph.publish('planner_node/confirm', data=True, kind=Bool)
        wait_for(lambda: graph.interpretation().status.name == 'WHOLE', 'the answer')
        assert graph.caller.call(START, GOAL)[1].code == 0
    finally:
        set_parameter(graph.caller, 'planner_node', 'instruction_policy', 'prefer')


def test_a_call_may_start_at_a_place_and_bring_the_places(graph, tmp_path, places_file):
    collection = json.loads(Path(places_file).read_text())
    collection['features'][1]['properties']['name'] = 'annex'
    own = tmp_path / 'own.geojson'
    own.write_text(json.dumps(collection))
    here = ['--namespace', SPACE, '--places', str(own), '--json']
    code, _, errors = ended(command(*here, '--from', 'annex', '--to', 'nowhere'))
    assert code == 2, errors
    assert graph.parameter('places_file') == places_file
    try:
        code, output, errors = ended(command(*here, '--from', 'annex', '--to', 'dock'))
        assert code == 0, errors
        assert graph.parameter('places_file') == str(own)
    finally:
        graph.planner.set_parameters([Parameter('places_file', value=places_file)])
    points = np.array(json.loads(output)['path'])
    assert np.abs(points[0] - (15, 7.5)).max() <= 1.0
    assert np.abs(points[-1] - (43.5, 4.5)).max() <= 1.0


def test_places_are_published_as_markers_and_as_geojson(graph):
    markers, texts = [], []
    graph.caller.listen(MarkerArray, 'planner_node/places', markers.append, LATCHED)
    graph.caller.listen(String, 'planner_node/places_geojson', texts.append, LATCHED)
    wait_for(lambda: markers and texts and 'goals' in texts[-1].data, 'the places')
    names = [marker.text for marker in markers[-1].markers if marker.text]
    assert names == ['dock', 'lab', 'press']
    collection = json.loads(texts[-1].data)
    assert set(collection['goals']) == set(PLACES)


def test_a_bad_places_file_is_refused_and_the_last_places_stay(graph, tmp_path, places_file):
    bad = tmp_path / 'bad.geojson'
    collection = json.loads(Path(places_file).read_text())
    collection['features'][1]['properties']['name'] = 'dock'
    bad.write_text(json.dumps(collection))
    refused = set_parameter(graph.caller, 'planner_node', 'places_file', str(bad))
    assert not refused.successful
    assert 'feature 1' in refused.reason
    assert "'dock' is also a name of feature 0" in refused.reason
    graph.instruct('visit the dock')
    assert graph.interpretation().sentence == 'visit the dock'
    assert set_parameter(graph.caller, 'planner_node', 'places_file', '').successful
    assert graph.interpretation().sentence == 'not understood: "visit the dock"'
    assert set_parameter(graph.caller, 'planner_node', 'places_file', places_file).successful
    assert graph.interpretation().sentence == 'visit the dock'


def test_the_state_of_the_instruction_is_in_the_diagnostics(graph):
    graph.instruct('avoid the lab')
    health = graph.caller._health

    def state():
        return health.get('instructed/planner_node: planner', {})

    wait_for(lambda: state().get('instruction') == 'avoid the lab', 'the diagnostics')
    assert state()['instruction_status'] == 'understood'
    assert state()['instruction_understood'] == 'avoid the lab'
    assert state()['instruction_understood_by'] == 'grammar'
    assert state()['places'] == 3
