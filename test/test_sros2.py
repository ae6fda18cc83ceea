"""The SROS2 policies grant the nodes exactly what they have in the running graph."""

import importlib.util
import sys
from pathlib import Path
from xml.etree import ElementTree as ET

import pytest
import rclpy
from graph_tools import calling, running, wait_for
from llm_astar_lab.nodes.benchmark_node import LiveRun
from llm_astar_planner.nodes.llm_client_node import LlmClientNode
from llm_astar_planner.nodes.map_node import MapNode
from llm_astar_planner.nodes.planner.planner_node import PlannerNode

ROOT = Path(__file__).parents[1]
sys.path.insert(0, str(ROOT / 'docs'))
import make_sros2_policies as generator  # noqa: E402 - it lies beside the documents

NODES = ('map_node', 'llm_client_node', 'planner_node', 'benchmark_node')
NAMESPACE = '/guarded'
# What SROS2's schema (policy.xsd, version 0.2.0) allows in each element, and its attributes.
CHILDREN = {
    'policy': {'enclaves'}, 'enclaves': {'enclave'}, 'enclave': {'profiles'},
    'profiles': {'profile'}, 'profile': {'topics', 'services', 'actions'},
    'topics': {'topic'}, 'services': {'service'}, 'actions': {'action'},
    'topic': set(), 'service': set(), 'action': set(),
}  # fmt: skip
ATTRIBUTES = {
    'policy': {'version'}, 'enclave': {'path'}, 'profile': {'ns', 'node'},
    'topics': {'publish', 'subscribe'}, 'services': {'reply', 'request'},
    'actions': {'call', 'execute'},
}  # fmt: skip
# What is in the graph where these packages are installed, or time is simulated.
OPTIONAL = ('nav2_msgs', 'map_msgs', 'bond', 'tf2_ros')


@pytest.fixture(scope='module', autouse=True)
def _context():
    rclpy.init()
    yield
    rclpy.try_shutdown()


def policies(namespace='/'):
    return generator.policies(generator.REFERENCE.read_text(), namespace)


def test_the_policies_are_made_of_the_reference():
    assert (ROOT / 'config' / 'sros2' / 'policies.xml').read_text() == policies()


def test_the_policies_have_the_form_of_the_schema():
    root = ET.fromstring(policies())
    assert (root.tag, root.get('version')) == ('policy', '0.2.0')
    for element in root.iter():
        assert {child.tag for child in element} <= CHILDREN[element.tag]
        assert set(element.attrib) <= ATTRIBUTES.get(element.tag, set())
        if element.tag in ('topics', 'services', 'actions'):
            assert set(element.attrib.values()) == {'ALLOW'}
        if not CHILDREN[element.tag]:
            assert '*' not in element.text
        else:
            assert len(element)
    paths = [enclave.get('path') for enclave in root.iter('enclave')]
    assert sorted(paths) == sorted(f'/llm_astar/{node}' for node in NODES)


def test_the_launch_file_starts_each_process_in_its_enclave():
    launch = (ROOT / 'src/llm_astar_planner/launch/planner.launch.py').read_text()
    assert f"'--enclave', f'{generator.ENCLAVES}/{{executable}}'" in launch


def granted(namespace):
    """Return what the policies grant to each process: kinds and full names."""
    found = {}
    verbs = {(what, verb): kind for kind, (what, verb) in generator.KINDS.items()}
    for enclave in ET.fromstring(policies(namespace)).iter('enclave'):
        names = found.setdefault(enclave.get('path').rpartition('/')[2], set())
        for profile in enclave.iter('profile'):
            for group in profile:
                (verb,) = group.attrib
                for one in group:
                    names.add((verbs[one.tag, verb], full_name(profile, one.text)))
    return found


def full_name(profile, name):
    """Resolve a name as SROS2 does."""
    base = profile.get('ns').rstrip('/')
    if name.startswith('/'):
        return name
    return f'{base}/{profile.get("node")}{name[1:]}' if name[0] == '~' else f'{base}/{name}'


def in_graph(observer, name):
    """Return what a node has in the graph, as `granted` does."""
    found = set()
    for kind, what in (('pub', 'publisher'), ('sub', 'subscriber'), ('srv', 'service'),
                       ('call', 'client')):  # fmt: skip
        ask = getattr(observer, f'get_{what}_names_and_types_by_node')
        found |= {(kind, topic) for topic, _ in ask(name, NAMESPACE)}
    return found


def process_of(name):
    return next(node for node in NODES if node in name)


def test_the_policies_grant_what_the_running_nodes_have_and_nothing_else():
    nodes = [make(namespace=NAMESPACE) for make in (MapNode, LlmClientNode, PlannerNode)]
    expected = granted(NAMESPACE)
    absent = {name for name in OPTIONAL if importlib.util.find_spec(name) is None}
    notes = {
        entry.name: entry.note for entry in generator.entries(generator.REFERENCE.read_text())
    }
    optional = {name for name, note in notes.items() if any(one in note for one in absent)}
    with running(*nodes), calling(NAMESPACE, 'benchmark_node') as caller:
        caller.wait_until_ready(client='llm_client_node')
        run = LiveRun(caller, 'llm_client_node')
        with run:
            run.variants(['guided'])
            seen = {}

            def settled():
                before = {node: set(names) for node, names in seen.items()}
                seen.clear()
                for name, space in caller.node.get_node_names_and_namespaces():
                    if space == NAMESPACE:
                        found = in_graph(caller.node, name)
                        seen.setdefault(process_of(name), set()).update(found)
                return before == seen and set(seen) == set(NODES)

            wait_for(settled, 'the graph')
    for node in NODES:
        assert seen[node] <= expected[node], node
        unused = {
            (kind, name)
            for kind, name in expected[node] - seen[node]
            if name.removeprefix(f'{NAMESPACE}/').replace(f'{node}/', '~/', 1) not in optional
        }
        more = {f'{NAMESPACE}/{hidden}/get_type_description' for hidden in
                generator.HIDDEN_NODES.get(node, ())}  # fmt: skip
        assert {name for kind, name in unused} <= more | {'/clock'}, node
