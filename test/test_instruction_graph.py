"""An instruction through the live graph: from a topic to the model, and to the path."""

import pytest
import rclpy
from builtin_interfaces.msg import Time
from graph_tools import GOAL, START, calling, set_parameter, spinning, wait_for
from llm_astar_msgs_adapter.maps.grid_map import Pose2D
from llm_astar_msgs_adapter.messages.fields import path_from_message
from llm_astar_msgs_adapter.messages.writing import pose_to_message
from llm_astar_planner.nodes.llm_client_node import LlmClientNode
from llm_astar_planner.nodes.map_node import MapNode
from llm_astar_planner.nodes.planner.planner_node import PlannerNode
from nav_msgs.msg import Path
from nav_msgs.srv import GetPlan
from rclpy.parameter import Parameter
from std_msgs.msg import String

SPACE, OTHER = '/instructed', '/other'
INSTRUCTION = 'pass by 5, 5'
FOLLOWED = 'followed through 1 via point'
REPLAY = {
    'source': 'replay',
    'model': '',
    'transcript': 'demo_transcript.jsonl',
    'dataset': 'demo.json',
}


@pytest.fixture(scope='module', autouse=True)
def _context():
    rclpy.init()
    yield
    rclpy.try_shutdown()


def planner_in(namespace):
    """Make a planner that waits for waypoints, with an instruction or without."""
    waits = Parameter('search_while_waiting', value=False)
    return PlannerNode(namespace=namespace, parameter_overrides=[waits])


@pytest.fixture(scope='module')
def nodes(_context):
    """The three nodes in this process, and a caller of them."""
    nodes = [MapNode(namespace=SPACE), LlmClientNode(namespace=SPACE), planner_in(SPACE)]
    with spinning(*nodes), calling(SPACE) as caller:
        caller.wait_until_ready(client='llm_client_node')
        yield nodes[1], nodes[2], caller


@pytest.fixture
def graph(nodes):
    """The nodes, once the parameters gave the client a new source and no instruction is set."""
    client, planner, caller = nodes
    planner.set_parameters([Parameter('instruction', value='')])

    def start(**parameters):
        changes = [Parameter(name, value=value) for name, value in parameters.items()]
        result = client.set_parameters_atomically(changes)
        assert result.successful, result.reason
        return client, planner, caller

    return start


def is_seen(caller):
    return caller._health.get('other/planner_node: planner', {}).get('llm_client_ready')


def test_an_instruction_on_the_topic_reaches_the_model_and_bends_the_path(graph, chat_server):
    chat_server.script = [chat_server.completion('Generated Path: [[39, 18], [5, 5], [7, 19]]')]
    _, planner, caller = graph(
        source='endpoint', base_url=chat_server.base_url, model='tiny', timeout_s=20.0
    )
    topic = caller.node.create_publisher(String, 'planner_node/instruction', 10)
    wait_for(topic.get_subscription_count, 'the topic')

    def instruction():
        return planner.get_parameter('instruction').value

    topic.publish(String(data=INSTRUCTION))
    wait_for(lambda: instruction() == INSTRUCTION, 'the instruction')
    path, report, _ = caller.call(START, GOAL)
    assert (report.code, report.instruction) == (0, FOLLOWED)
    assert report.guided_by == 'endpoint:tiny'
    assert [5.0, 5.0] in path_from_message(path).round(6).tolist()
    again = caller.call(START, GOAL)[1]
    assert again.instruction == FOLLOWED
    assert len(chat_server.requests) == 1  # the client answers from its cache
    prompt = chat_server.requests[0]['messages'][0]['content']
    assert f'Instruction: "{INSTRUCTION}"\nIts places' in prompt

    topic.publish(String(data='x' * 501))
    refused = set_parameter(caller, 'planner_node', 'instruction', 'x' * 501)
    assert not refused.successful
    assert '501 characters are more than 500' in refused.reason
    assert instruction() == INSTRUCTION

    topic.publish(String(data=''))
    wait_for(lambda: not instruction(), 'no instruction')
    assert caller.call(START, GOAL)[1].instruction == ''
    wait_for(lambda: len(chat_server.requests) > 1, 'the query without an instruction')
    assert 'Instruction: ' not in chat_server.requests[1]['messages'][0]['content']


def test_an_answer_counts_only_for_the_instruction_it_was_made_with(graph, chat_server):
    """The planner notices when somebody else set another instruction, and sets its own again."""
    chat_server.script = [chat_server.completion('Generated Path: [[39, 18], [5, 5], [7, 19]]')]
    client, _, caller = graph(
        source='endpoint', base_url=chat_server.base_url, model='tiny', timeout_s=20.0
    )
    assert set_parameter(caller, 'planner_node', 'instruction', INSTRUCTION).successful
    assert caller.call(START, GOAL)[1].instruction == FOLLOWED
    assert set_parameter(caller, 'llm_client_node', 'instruction', 'something else').successful
    assert caller.call(GOAL, START)[1].instruction == FOLLOWED
    assert client.get_parameter('instruction').value == INSTRUCTION
    prompts = [request['messages'][0]['content'] for request in chat_server.requests]
    assert ['something else' in text for text in prompts] == [False, True, False]


def test_an_instruction_that_a_client_cannot_read_is_ignored_with_the_reason(graph):
    _, _, caller = graph(**REPLAY)
    assert set_parameter(caller, 'planner_node', 'instruction', INSTRUCTION).successful
    report = caller.call(START, GOAL)[1]
    assert (report.code, report.guided_by) == (0, 'replay:hand-written example')
    reason = 'replay: the recording was made without this instruction'
    assert report.instruction == f'ignored: {reason}'
    assert set_parameter(caller, 'llm_client_node', 'source', 'oracle').successful
    assert caller.call(START, GOAL)[1].instruction == (
        'ignored: source oracle cannot read instructions'
    )


def test_any_other_client_has_its_waypoints_used_and_the_instruction_ignored():
    """Any GetPlan service may return waypoints; one that cannot read instructions says nothing."""

    def answer(request, response):
        pose = pose_to_message(Pose2D(12.0, 9.0), 'map', Time())
        response.plan = Path(header=pose.header, poses=[pose])
        return response

    client = rclpy.create_node('llm_client_node', namespace=OTHER)
    client.create_service(GetPlan, '~/get_waypoints', answer)
    with (
        spinning(MapNode(namespace=OTHER), planner_in(OTHER), client),
        calling(OTHER) as caller,
    ):
        caller.wait_until_ready()
        caller.wait_for(lambda: is_seen(caller), 'the client', 15.0)
        assert set_parameter(caller, 'planner_node', 'instruction', INSTRUCTION).successful
        report = caller.call(START, GOAL)[1]
    assert (report.code, report.guided_by) == (0, 'llm_client')
    assert report.instruction.startswith('ignored: /other/llm_client_node refused it: ')
