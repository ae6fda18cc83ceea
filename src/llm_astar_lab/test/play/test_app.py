"""The page's server over real HTTP: what it serves, and what it refuses."""

import asyncio
import base64
import concurrent.futures
import contextlib
import io
import json
import socket
import threading
import time

import httpx
import numpy as np
import pytest
from llm_astar_lab.play import server as play_app
from llm_astar_lab.play.planning import Worker
from llm_astar_planner.search.methods import METHODS
from PIL import Image

DEMO = {'map': 'demo.json:0', 'start': [39, 18], 'goal': [7, 19]}
HOUSE = 'instructions/house.yaml'


# Python reads lists within lists up to about a thousand, and writes them up to some fewer.
DEPTHS = (5, 100, *range(850, 1000, 10))


def plan(page, status=200, **fields):
    answer = page.post('/api/plan', json={**DEMO, **fields})
    assert answer.status_code == status, answer.text
    return answer.json()


SQUARE = [[2.0, 2.0], [4.0, 2.0], [4.0, 4.0], [2.0, 4.0]]


def drawn(name, corners, **properties):
    """Return a place as the page sends it, or a zone, which has a cost."""
    geometry = {'type': 'Polygon', 'coordinates': [[*corners, corners[0]]]}
    feature = {'type': 'Feature', 'properties': {'name': name, **properties}, 'geometry': geometry}
    return json.dumps({'type': 'FeatureCollection', 'features': [feature]})


def cells_of(reply, height, width):
    numbers = np.frombuffer(base64.b64decode(reply['cells']), dtype=np.uint8)
    return numbers.reshape(height, width)


def test_the_page_itself_is_served_with_a_policy(page):
    answer = page.get('/')
    assert answer.headers['content-type'].startswith('text/html')
    assert "default-src 'self'" in answer.headers['content-security-policy']
    assert page.get('/page/index.html').text == answer.text


def test_the_options_name_every_map_and_limit(page):
    options = page.get('/api/options').json()
    names = {entry['id']: entry for entry in options['maps']}
    assert names['instructions/house.yaml']['unit'] == 'm'
    assert names['demo.json:0']['unit'] == 'cells'
    assert options['limits']['cells'] == 4_000_000
    assert options['colours']['waypoint']['accepted'].startswith('#')
    assert not options['live']


def test_a_map_has_its_cells_pairs_and_places(page):
    house = page.get('/api/map', params={'id': 'instructions/house.yaml'}).json()
    cells = cells_of(house, house['height'], house['width'])
    assert set(np.unique(cells)) <= {*range(101), 255}
    assert {place['name'] for place in house['places']} >= {'kitchen', 'study'}
    for pair in house['pairs']:
        x, y = pair['start']
        assert cells[y, x] == 0
    demo = page.get('/api/map', params={'id': 'demo.json:0'}).json()
    assert cells_of(demo, demo['height'], demo['width'])[0].tolist() == [100] * demo['width']


def test_a_plan_stands_beside_those_without_waypoints_and_of_astar(page):
    reply = plan(page, source='oracle', method='guided')
    assert [entry['role'] for entry in reply['plans']] == ['chosen', 'no_waypoints', 'astar']
    chosen, alone, astar = reply['plans']
    assert chosen['found']
    assert chosen['path'][0] == [39, 18]
    assert chosen['path'][-1] == [7, 19]
    assert chosen['waypoints']
    assert not alone['waypoints']
    assert chosen['ratio'] >= 1.0
    assert astar['ratio'] is None
    assert astar['length'] <= chosen['length'] + 1e-9


@pytest.mark.parametrize('method', METHODS)
def test_the_cells_come_in_the_order_in_which_the_search_expanded_them(page, method):
    demo = page.get('/api/map', params={'id': 'demo.json:0'}).json()
    for entry in plan(page, method=method, source='embedded')['plans']:
        numbers = base64.b64decode(entry['expanded']['order'])
        rows, columns = np.divmod(np.frombuffer(numbers, dtype='<i4'), demo['width'])
        assert entry['order_is_known']
        assert [columns[0], rows[0]] == DEMO['start']
        assert 0 < len(set(zip(rows, columns))) == len(rows) <= entry['operation']
        # Each cell was reached from one that was expanded before.
        for count in range(1, len(rows)):
            steps = np.abs([rows[:count] - rows[count], columns[:count] - columns[count]])
            assert steps.max(axis=0).min() == 1


def test_a_reply_typed_as_a_model_would_is_used_instead_of_the_source(page):
    reply = plan(page, source='oracle', reply='Generated Path: [[5, 5], [9, 16], [1000, 3]]')
    statuses = [status for *_, status in reply['plans'][0]['waypoints']]
    assert statuses[-1] == 'out_of_bounds'
    assert len(statuses) == 3


def test_drawn_walls_are_walls_and_erased_ones_are_none(page):
    free = plan(page)['plans'][0]
    middle = free['path'][len(free['path']) // 2]
    drawn = plan(page, walls=[[*middle, 100]])
    assert middle not in drawn['plans'][0]['path']
    assert drawn['command'] is None
    assert 'walls' in drawn['command_note']
    demo = page.get('/api/map', params={'id': 'demo.json:0'}).json()
    cells = cells_of(demo, demo['height'], demo['width'])
    walls = [[int(x), int(y), 0] for y, x in np.argwhere(cells[1:-1, 1:-1]) + 1]
    erased = plan(page, walls=walls, method='exact_astar')['plans'][0]
    assert erased['length'] == pytest.approx(31 + 2**0.5)


def test_a_drawn_cost_and_a_drawn_zone_turn_the_path_aside(page):
    ask = {'map': HOUSE, 'start': [27, 30], 'goal': [135, 95], 'method': 'exact_astar'}
    ask['robot_radius'] = 0.2
    assert crossed(plan(page, **ask))
    costs = [[x, y, 50] for y in range(41, 50) for x in range(54, 86)]
    corners = [[5.4, 4.1], [8.6, 4.1], [8.6, 5.0], [5.4, 5.0]]
    for changed in ({'walls': costs}, {'drawn': drawn('spill', corners, cost=100)}):
        reply = plan(page, **ask, **changed)
        assert reply['command'] is None
        assert not crossed(reply)


def crossed(reply):
    path = reply['plans'][0]['path']
    return [cell for cell in path if 54 <= cell[0] < 86 and 41 <= cell[1] < 50]


def test_a_drawn_rule_of_the_road_is_planned_with_and_sent_back_with_its_arrows(page):
    free = plan(page)['plans'][0]
    line = {'type': 'LineString', 'coordinates': [[5.0, 9.0], [35.0, 9.0]]}
    rule = {'name': 'east', 'kind': 'one_way', 'width': 3.0}
    feature = {'type': 'Feature', 'properties': rule, 'geometry': line}
    features = {'type': 'FeatureCollection', 'features': [feature]}
    reply = plan(page, drawn=json.dumps(features))
    (sent,) = reply['rules']
    assert (sent['kind'], sent['name'], sent['width']) == ('one_way', 'east', 3.0)
    assert sent['arrows'] == [[[5.0, 9.0], [35.0, 9.0]]]
    assert sent['rings']
    assert reply['plans'][0]['length'] > free['length'] + 1.0


def test_causes_and_ways_are_sent_as_a_plan_has_them(page):
    closed = plan(page, robot_radius=5.0)['plans'][0]
    assert [cause['name'] for cause in closed['causes']] == ['radius']
    assert closed['causes'][0]['points']
    chosen, astar = plan(page, alternatives=3)['plans']
    assert [round(way['length'], 1) for way in chosen['ways']] == [43.4, 46.7]
    assert chosen['ways'][1]['path'][0] == DEMO['start']
    assert astar['ways'] == []


def test_a_question_about_the_path_is_answered_or_said_not_to_be_understood(page):
    house = {'map': HOUSE, 'start': [27, 30], 'goal': [135, 95], 'robot_radius': 0.2}
    reply = plan(page, **house, why='why not through the green bathroom?')
    answer = reply['answer']
    assert answer['sentence'].startswith('through the green bathroom: 15.2 m instead of 14.2 m')
    assert answer['path'][0] == [27, 30]
    assert "'--why=why not through the green bathroom?'" in reply['command']
    assert plan(page, **house, why='why so long?')['answer']['path'] == []
    answer = plan(page, **house, why='why me?')['answer']
    assert 'is not understood; ask' in answer['sentence']
    assert answer['path'] == []
    assert plan(page)['answer'] is None


def test_a_drawn_place_is_understood_and_replaces_one_of_its_name(page):
    ask = {'map': HOUSE, 'start': [27, 30], 'goal': [135, 95]}
    for name in ('charger', 'sofa'):
        asked = ask | {'drawn': drawn(name, SQUARE), 'instruction': f'visit the {name}'}
        shown = plan(page, **asked)['plans'][0]
        assert shown['instruction_report']['satisfied']
        (x, y), *_ = shown['regions']['visits']
        assert 19 <= x <= 40
        assert 19 <= y <= 40


def test_the_areas_of_an_instruction_are_sent_with_what_became_of_them(page):
    ask = {'map': HOUSE, 'start': [27, 30], 'goal': [135, 95]}
    ask['instruction'] = 'visit the blue bedroom and avoid the hall'
    regions = plan(page, **ask)['plans'][0]['regions']
    assert [(a['is_avoided'], a['status']) for a in regions['areas']] == [
        (False, 'KEPT'),
        (True, 'IMPOSSIBLE'),
    ]
    assert regions['areas'][1]['rings'][0][0] == pytest.approx([159.5, 51.0], abs=1)
    assert regions['violations']
    assert len(regions['visits']) == 1


def png(rows):
    file = io.BytesIO()
    Image.fromarray(np.array(rows, dtype=np.uint8)).save(file, 'png')
    return file.getvalue()


def drop(page, status=200, **files):
    body = {
        name.replace('_', '.'): base64.b64encode(content).decode()
        for name, content in files.items()
    }
    answer = page.post('/api/map', json=body)
    assert answer.status_code == status, answer.text
    return answer.json()


ROOM = np.full((20, 30), 254)
ROOM[10, :20] = 0
YAML = b"""image: /etc/passwd
resolution: 0.1
origin: [-1.0, 2.0, 0.0]
negate: 0
occupied_thresh: 0.65
free_thresh: 0.25
"""


def test_a_dropped_map_is_planned_on_with_the_image_that_came_with_it(page):
    key = drop(page, room_yaml=YAML, room_png=png(ROOM))
    sent = page.get('/api/map', params={'id': key}).json()
    assert (sent['width'], sent['height'], sent['resolution']) == (30, 20, 0.1)
    assert sent['origin'] == [-1.0, 2.0, 0.0]
    reply = plan(page, map=key, start=[2, 2], goal=[2, 17])
    assert reply['plans'][0]['found']
    assert '--map room.yaml' in reply['command']
    alone = drop(page, room_png=png(ROOM))
    assert page.get('/api/map', params={'id': alone}).json()['resolution'] == 0.05


@pytest.mark.parametrize(
    ('files', 'words'),
    [
        ({}, 'drop an image'),
        ({'room_yaml': YAML}, 'drop an image, or a yaml together with its image, not room.yaml'),
        ({'a_png': png(ROOM), 'b_png': png(ROOM)}, 'not a.png, b.png'),
        ({'room_yaml': b'resolution: x', 'room_png': png(ROOM)}, 'room.yaml: '),
        ({'room_yaml': b'[', 'room_png': png(ROOM)}, 'room.yaml: not yaml'),
        ({'room_yaml': YAML, 'room_png': b'no image'}, "cannot identify image file 'room.png'"),
        ({'room_png': png(np.zeros((3000, 3000)))}, 'room.png: 3000 x 3000 cells are over'),
        ({'room_png': png(np.zeros((9, 9)))}, 'room.png: no two of its free cells'),
    ],
)
def test_files_that_are_no_map_are_refused_by_their_names(page, files, words):
    reply = drop(page, status=422, **files)
    assert words in reply['error']
    assert 'map.yaml' not in reply['error']
    assert reply['field'] == 'map'


def test_dropped_maps_are_kept_up_to_a_number(page, played_maps):
    shipped = len([known for known in played_maps if not known.id.startswith('dropped/')])
    for number in range(12):
        drop(page, **{f'room{number}_png': png(ROOM)})
    assert len(list(played_maps)) == shipped + 10
    assert page.post('/api/map', json={'a.png': 3}).status_code == 422
    assert page.post('/api/map', json=[1]).status_code == 422


def test_a_radius_closes_cells_and_the_path_keeps_off_them(page):
    ask = {'map': 'instructions/house.yaml', 'robot_radius': 0.3}
    pair = page.get('/api/map', params={'id': ask['map']}).json()['pairs'][0]
    reply = plan(page, **ask, **pair)
    house = page.get('/api/map', params={'id': ask['map']}).json()
    bits = np.frombuffer(base64.b64decode(reply['lethal']), dtype=np.uint8)
    closed = np.unpackbits(bits)[: house['width'] * house['height']]
    closed = closed.reshape(house['height'], house['width'])
    assert closed.any()
    assert not closed[cells_of(house, house['height'], house['width']) == 100].any()
    if reply['plans'][0]['found']:
        x, y = np.array(reply['plans'][0]['path']).T
        assert not closed[y, x].any()


def test_each_clause_of_an_instruction_has_its_outcome(page):
    ask = {'map': 'instructions/house.yaml', 'instruction': 'avoid the hall and visit the kitchen'}
    pair = page.get('/api/map', params={'id': ask['map']}).json()['pairs'][0]
    outcome = plan(page, **ask, **pair)['plans'][0]['instruction_report']
    assert 'hall' in outcome['sentence']
    ask['instruction'] = 'avoid the study'
    assert plan(page, **ask, **pair)['plans'][0]['order_is_known']
    statuses = {clause['clause']: clause['status'] for clause in outcome['clauses']}
    assert len(statuses) == 2
    assert statuses['visit the kitchen'] in ('kept', 'not kept')


@pytest.mark.parametrize('host', ['evil.example', 'evil.example:8321', '127.0.0.1.evil.example'])
def test_a_name_that_is_not_the_servers_is_refused(page, host):
    answer = page.get('/api/options', headers={'Host': host})
    assert answer.status_code == 421
    assert '--host' in answer.json()['error']


@pytest.mark.parametrize('host', ['localhost', 'LOCALHOST:99', '[::1]:8321', '127.0.0.1'])
def test_the_names_of_this_machine_are_accepted(page, host):
    assert page.get('/api/options', headers={'Host': host}).status_code == 200


@pytest.mark.parametrize('origin', ['http://evil.example', 'null', 'https://127.0.0.1'])
def test_pages_of_other_sites_are_refused(page, origin):
    answer = page.post('/api/plan', json=DEMO, headers={'Origin': origin})
    assert answer.status_code == 403


def test_a_link_of_another_site_may_be_followed_but_nothing_be_embedded(page):
    for mode, status in (('no-cors', 403), ('cors', 403), ('navigate', 200)):
        headers = {'Sec-Fetch-Site': 'cross-site', 'Sec-Fetch-Mode': mode}
        assert page.get('/', headers=headers).status_code == status
        assert page.get('/api/options', headers=headers).status_code == status


def test_the_page_of_this_site_is_not(page, play_url):
    assert page.post('/api/plan', json=DEMO, headers={'Origin': play_url}).status_code == 200


def test_forms_of_other_sites_are_refused(page):
    body = json.dumps(DEMO)
    for kind in ('text/plain', 'application/x-www-form-urlencoded', ''):
        answer = page.post('/api/plan', content=body, headers={'Content-Type': kind})
        assert answer.status_code == 415


@pytest.mark.parametrize(
    'path',
    [
        '/page/../app.py',
        '/page/%2e%2e/app.py',
        '/page/..%2fapp.py',
        '/page//etc/passwd',
        '/app.py',
    ],
)
def test_no_file_but_the_pages_own_is_served(play_url, path):
    host, port = play_url.removeprefix('http://').split(':')
    with socket.create_connection((host, int(port))) as connection:
        connection.sendall(f'GET {path} HTTP/1.1\r\nHost: localhost\r\n\r\n'.encode())
        assert b' 404 ' in connection.recv(100)


@pytest.mark.parametrize('name', ['../../etc/passwd', '/etc/passwd', '', 'demo.json:9', 'x' * 500])
def test_no_map_but_the_listed_ones_is_served(page, name):
    answer = page.get('/api/map', params={'id': name})
    assert answer.status_code == 404
    assert answer.json()['field'] == 'map'


def test_a_huge_body_is_refused_before_it_is_read(page):
    reply = page.post(
        '/api/plan', content=b'[' * 2_000_000, headers={'Content-Type': 'application/json'}
    )
    assert reply.status_code == 413

    def endless():
        while True:
            yield b' ' * 65536

    kind = {'Content-Type': 'application/json'}
    # The answer, or an error: the server closes the connection while the client still sends.
    with contextlib.suppress(httpx.TransportError):
        assert page.post('/api/plan', content=endless(), headers=kind).status_code == 413
    assert plan(page)['plans'][0]['found']


@pytest.mark.parametrize(
    ('body', 'word'),
    [
        (b'', 'JSON'),
        (b'{', 'JSON'),
        (b'[' * 500_000, 'nested'),
        (b'{"a":' * 100_000, 'nested'),
        *((b'{"start": %b%b}' % (b'[' * depth, b']' * depth), 'nested') for depth in DEPTHS),
        (b'{"start": [NaN, 1]}', 'NaN'),
        (b'{"start": [Infinity, 1]}', 'Infinity'),
        (b'\xff\xfe', 'JSON'),
    ],
)
def test_what_is_no_json_is_refused(page, body, word):
    answer = page.post('/api/plan', content=body, headers={'Content-Type': 'application/json'})
    assert answer.status_code == 400
    assert word in answer.json()['error']


@pytest.mark.parametrize(
    ('fields', 'field'),
    [
        ({'start': [1, 2, 3]}, 'start'),
        ({'start': [1.5, 2]}, 'start'),
        ({'start': [True, 2]}, 'start'),
        ({'goal': [51, 5]}, 'goal'),
        ({'goal': [-1, 5]}, 'goal'),
        ({'goal': [10**300, 5]}, 'goal'),
        ({'goal': None}, 'goal'),
        ({'method': 'teleport'}, 'method'),
        ({'method': ['astar']}, 'method'),
        ({'method': 'x' * 100_000}, 'method'),
        ({'source': 'endpoint'}, 'source'),
        ({'source': []}, 'source'),
        ({'source': 'reply'}, 'reply'),
        ({'reply': 'x' * 70_000}, 'reply'),
        ({'reply': 7}, 'reply'),
        ({'heuristic': 'none'}, 'heuristic'),
        ({'robot_radius': -1}, 'robot_radius'),
        ({'robot_radius': 1e9}, 'robot_radius'),
        ({'robot_radius': '1'}, 'robot_radius'),
        ({'max_suboptimality': 0.5}, 'max_suboptimality'),
        ({'instruction': 'x' * 501}, 'instruction'),
        ({'confirm': 'yes'}, 'instruction'),
        ({'via': [[5, 5]] * 101}, 'via'),
        ({'via': 'here'}, 'via'),
        ({'walls': [[0, 0, 0]] * 60_001}, 'walls'),
        ({'walls': [[0, 99, 0]]}, 'walls'),
        ({'walls': [[0, 0]]}, 'walls'),
        ({'walls': [[0, 0, 101]]}, 'walls'),
        ({'walls': [[0, 0, 1.5]]}, 'walls'),
        ({'walls': 3}, 'walls'),
        ({'drawn': '{'}, 'drawn'),
        ({'drawn': '[' * 100_000}, 'drawn'),
        ({'drawn': '{"type": "FeatureCollection", "features": [3]}'}, 'drawn'),
        ({'drawn': drawn('dock', [[0, 0], [2, 2], [2, 0], [0, 2]])}, 'drawn'),
        ({'drawn': drawn('spill', SQUARE, cost=101)}, 'drawn'),
        ({'drawn': 7}, 'drawn'),
        ({'base_url': 'http://evil.example'}, ''),
    ],
)
def test_what_cannot_be_used_is_named(page, fields, field):
    reply = plan(page, status=422, **fields)
    assert reply['field'] == field
    assert 0 < len(reply['error']) <= 400


def test_ten_pages_at_once_are_answered_or_told_to_wait(play_url):
    def ask(number):
        fields = {**DEMO, 'source': 'random', 'start': [5 + number, 5]}
        return httpx.post(f'{play_url}/api/plan', json=fields, trust_env=False, timeout=60.0)

    with concurrent.futures.ThreadPoolExecutor(10) as threads:
        answers = list(threads.map(ask, range(10)))
    assert {answer.status_code for answer in answers} <= {200, 503}
    for number, answer in enumerate(answers):
        if answer.status_code == 200:
            assert answer.json()['plans'][0]['start'] == [5 + number, 5]


def test_a_slow_body_does_not_hold_up_others(page, play_url, monkeypatch):
    monkeypatch.setattr(play_app, 'BODY_S', 0.3)
    host, port = play_url.removeprefix('http://').split(':')
    head = 'POST /api/plan HTTP/1.1\r\nHost: localhost\r\nContent-Type: application/json\r\n'
    with socket.create_connection((host, int(port))) as connection:
        connection.sendall(f'{head}Content-Length: 100\r\n\r\n{{'.encode())
        assert plan(page)['plans'][0]['found']
        assert b' 408 ' in connection.recv(100)


def test_a_plan_ends_when_its_page_has_gone():
    begun, seen = threading.Event(), threading.Event()

    def job(stop):
        begun.set()
        while not stop[0]:
            time.sleep(0.005)
        seen.set()

    async def ask():
        worker = Worker()
        gone = asyncio.create_task(asyncio.to_thread(begun.wait))
        with pytest.raises(play_app.PlayError):
            await worker.run(job, gone)
        worker.close()

    asyncio.run(ask())
    assert seen.wait(60.0)


def test_a_page_that_closes_its_connection_stops_its_plan(play_url, page, monkeypatch):
    begun, stopped = threading.Event(), threading.Event()

    def work(self, asked, stop):
        begun.set()
        while not stop[0]:
            time.sleep(0.005)
        stopped.set()
        return b'{}'

    with monkeypatch.context() as patch:
        patch.setattr(play_app.PlayApp, 'work', work)
        host, port = play_url.removeprefix('http://').split(':')
        body = json.dumps(DEMO)
        head = 'POST /api/plan HTTP/1.1\r\nHost: localhost\r\nContent-Type: application/json\r\n'
        with socket.create_connection((host, int(port))) as connection:
            connection.sendall(f'{head}Content-Length: {len(body)}\r\n\r\n{body}'.encode())
            assert begun.wait(30.0)
        assert stopped.wait(30.0)
    assert plan(page)['plans'][0]['found']
