"""The page of `llm-astar play` in a real headless Chromium."""

import json
import re
import shutil
import subprocess
import sys
import urllib.request
from urllib.parse import quote

import pytest

playwright = pytest.importorskip('playwright.sync_api', reason='playwright is not installed')
expect = playwright.expect
CHROMIUM = next(filter(None, map(shutil.which, ('chromium', 'chromium-browser'))), None)
if CHROMIUM is None:
    pytest.skip('there is no chromium: apt-get install chromium', allow_module_level=True)
ARGUMENTS = [
    '--no-sandbox', '--disable-gpu', '--disable-quic', '--no-first-run',
    '--disable-background-networking', '--disable-component-update', '--disable-sync',
]  # fmt: skip
# The first plan may have to wait for kernels to be compiled.
TIMEOUT_MS = 60_000
expect.set_options(timeout=TIMEOUT_MS)
DEMO = 'map=demo.json:0&method=llm_astar&source=embedded'
HOUSE = 'map=instructions/house.yaml&start=27,30&goal=135,95'
HOSTILE = "<img src=x onerror=\"document.title='hit'\"><script>document.title='hit'</script>"


@pytest.fixture(scope='module')
def url():
    command = [sys.executable, '-m', 'llm_astar_planner.cli.main', 'play', '--no-browser']
    with subprocess.Popen([*command, '--port', '0'], stdout=subprocess.PIPE, text=True) as server:
        found = re.search(r'http://\S+', server.stdout.readline())
        assert found, 'the server has not said where its page is'
        yield found.group()
        server.terminate()


@pytest.fixture(scope='module')
def browser():
    with playwright.sync_playwright() as tools:
        running = tools.chromium.launch(executable_path=CHROMIUM, args=ARGUMENTS)
        yield running
        running.close()


@pytest.fixture
def open_page(browser, url):
    """Open the page at a fragment; in the end no page may have written an error."""
    contexts, errors = [], []

    def opened(fragment='', stub=None, **options):
        options.setdefault('viewport', {'width': 1400, 'height': 900})
        context = browser.new_context(reduced_motion='reduce', **options)
        contexts.append(context)
        page = context.new_page()
        page.set_default_timeout(TIMEOUT_MS)
        page.on('pageerror', lambda error: errors.append(str(error)))
        page.on('console', lambda line: line.type == 'error' and errors.append(line.text))
        if stub:
            stub(page)
        page.goto(f'{url}#{fragment}')
        expect(page.locator('#main')).to_have_attribute('aria-busy', 'false')
        return page

    opened.errors = errors
    yield opened
    for context in contexts:
        context.close()
    assert errors == []


def middle(page, selector):
    box = page.locator(selector).bounding_box()
    return box['x'] + box['width'] / 2, box['y'] + box['height'] / 2


def drag(page, start, end):
    page.mouse.move(*start)
    page.mouse.down()
    page.mouse.move(*end, steps=4)
    page.mouse.up()


def expansions(page):
    return [
        int(text.replace(',', ''))
        for text in page.locator('#figures tr:nth-child(1) td').all_text_contents()
        if text
    ]


def wait_for_other(page, old):
    expect(page.locator('#figures')).not_to_have_text(old)
    expect(page.locator('#main')).to_have_attribute('aria-busy', 'false')


def test_dragging_the_goal_changes_the_figures(open_page):
    page = open_page(DEMO)
    expect(page.locator('#hint')).to_be_visible()
    before = page.locator('#figures').text_content()
    x, y = middle(page, '[data-handle=goal]')
    drag(page, (x, y), (x + 60, y + 10))
    wait_for_other(page, before)
    expect(page.locator('#hint')).to_be_hidden()
    expect(page.locator('#verdict')).to_contain_text('expansions')
    assert len(expansions(page)) == 3


class Person:
    """Counts what a person does on the page."""

    def __init__(self, page):
        self.page = page
        self.actions = 0

    def click(self, button):
        self.actions += 1
        self.page.get_by_role('button', name=button, exact=True).click()

    def write(self, text):
        """Write into the box and press Enter."""
        self.actions += 1
        self.page.locator('#instruction').fill(text)
        self.page.keyboard.press('Enter')

    def press_map(self, x, y):
        self.actions += 1
        self.page.mouse.click(*self.at(x, y))

    def drag(self, start, end):
        self.actions += 1
        drag(self.page, self.at(*start), self.at(*end))

    def at(self, x, y):
        """Return the pixel of a cell of the house, whose map is as high as its box."""
        box = self.page.locator('#board canvas').bounding_box()
        scale = (box['height'] - 48) / 120
        left = box['x'] + 46 + (box['width'] - 54 - 160 * scale) / 2
        return left + (x + 0.5) * scale, box['y'] + 8 + (119.5 - y) * scale


def plan_somewhere_else(person):
    person.drag((135, 95), (140, 20))
    expect(person.page).to_have_url(re.compile(r'goal=140,20'))


def keep_out_of_a_room(person):
    person.press_map(100, 100)
    person.click('Keep out')
    kept = person.page.locator('#clauses li', has_text='avoid the green bedroom')
    expect(kept.locator('.status')).to_have_text('kept')


def see_why_not(person):
    person.write('avoid the hall')
    expect(person.page.locator('#verdict')).to_contain_text('The instruction is impossible:')
    expect(person.page.locator('#clauses .status')).to_have_text('impossible')
    expect(person.page.locator('#clauses .detail')).to_contain_text('m inside')


def draw_a_wall(person):
    before = person.page.locator('.panel.main .figures').text_content()
    person.click('Draw wall')
    person.drag((27, 42), (20, 64))
    expect(person.page.locator('.panel.main .figures')).not_to_have_text(before)
    expect(person.page.locator('#legend')).to_contain_text('drawn wall')


def share(person):
    person.click('Share link')
    expect(person.page.locator('#toast')).to_have_text('The link is copied.')
    copied = person.page.evaluate('navigator.clipboard.readText()')
    assert 'instruction=visit' in copied


@pytest.mark.parametrize(
    'task', [plan_somewhere_else, keep_out_of_a_room, see_why_not, draw_a_wall, share]
)
def test_a_person_who_knows_only_the_page_does_each_task_in_three_actions(open_page, task):
    page = open_page(permissions=['clipboard-read', 'clipboard-write'])
    expect(page.locator('#verdict')).to_contain_text('The instruction is kept')
    person = Person(page)
    task(person)
    expect(page.locator('#main')).to_have_attribute('aria-busy', 'false')
    assert person.actions <= 3


def test_each_example_shows_what_its_name_says(open_page):
    page = open_page()
    shows = {
        'Instruction kept': 'The instruction is kept',
        'Impossible': 'The instruction is impossible',
        'A question': 'A question first',
        'A drawn wall': 'Path found',
        'Good waypoints': 'The waypoints win',
        'Bad waypoints': 'The search without waypoints wins',
        'Graded costs': 'Path found',
        'Why not?': 'Path found',
        'No path': "the robot's radius of 0.6 m closes the way",
        'Several ways': 'Path found',
        'Rules of the road': 'Path found',
        'The paper': 'The waypoints win',
    }
    assert page.locator('#examples button').all_text_contents() == list(shows)
    for name, words in shows.items():
        page.get_by_role('button', name=name, exact=True).click()
        expect(page.locator('#verdict')).to_contain_text(words)
        expect(page.locator('#examples [aria-pressed=true]')).to_have_text(name)
        expect(page.locator('#example-about')).not_to_be_empty()


def test_a_place_and_a_zone_are_drawn_named_planned_with_and_saved(open_page):
    page = open_page(HOUSE)
    person = Person(page)
    person.click('Place')
    person.drag((55, 95), (70, 110))
    page.locator('#place-name').fill('charger')
    page.keyboard.press('Enter')
    person.write('visit the charger')
    expect(page.locator('#clauses .status')).to_have_text('kept')
    # What the page says of a plan moves the map.
    expect(page.locator('#main')).to_have_attribute('aria-busy', 'false')
    person.click('Zone')
    for corner in ((60, 60), (75, 60), (75, 66), (60, 60)):
        person.press_map(*corner)
    expect(page.locator('#legend')).to_contain_text('closed zone')
    page.mouse.move(*person.at(74, 61))
    expect(page.locator('#readout')).to_contain_text('closed, hall, zone 1')
    expect(page.locator('#places')).to_contain_text('charger')
    again = open_page(page.url.split('#')[1])
    expect(again.locator('#legend')).to_contain_text('closed zone')
    with (
        page.expect_download(lambda file: 'places' in file.suggested_filename) as places_file,
        page.expect_download(lambda file: 'zones' in file.suggested_filename) as zones_file,
    ):
        page.get_by_role('button', name='Save GeoJSON').click()
    places, zones = (
        json.loads(file.value.path().read_text()) for file in (places_file, zones_file)
    )
    assert [zone['properties']['cost'] for zone in zones['features']] == [100]
    listed = [place['properties']['name'] for place in places['features']]
    assert listed[0] == 'hall'
    assert listed[-1] == 'charger'
    page.get_by_role('button', name='Undo').click()
    expect(page.locator('#legend')).not_to_contain_text('closed zone')


def test_a_painted_cost_turns_the_path_aside_and_is_read_under_the_pointer(open_page):
    page = open_page(HOUSE)
    before = page.locator('.panel.main .figures').text_content()
    person = Person(page)
    person.click('Draw cost')
    page.locator('#brush').select_option('15')
    person.drag((52, 45), (88, 45))
    expect(page.locator('.panel.main .figures')).not_to_have_text(before)
    page.mouse.move(*person.at(60, 45))
    expect(page.locator('#readout')).to_contain_text('free, cost 50 of 100, dining room')
    expect(page).to_have_url(re.compile('costs=50'))


MAP_YAML = """image: room.pgm
resolution: 0.1
origin: [0.0, 0.0, 0.0]
negate: 0
occupied_thresh: 0.65
free_thresh: 0.25
"""
DESK = {
    'type': 'Feature',
    'properties': {'name': 'desk'},
    'geometry': {'type': 'Polygon', 'coordinates': [[[2, 1], [3, 1], [3, 2], [2, 2], [2, 1]]]},
}


def dropped_files():
    room = b'P5 60 40 255 ' + bytes([254] * 2400)
    places = json.dumps({'type': 'FeatureCollection', 'features': [DESK]}).encode()
    return [
        {'name': 'room.yaml', 'mimeType': 'text/plain', 'buffer': MAP_YAML.encode()},
        {'name': 'room.pgm', 'mimeType': 'image/x-portable-graymap', 'buffer': room},
        {'name': 'room.geojson', 'mimeType': 'application/geo+json', 'buffer': places},
    ]


def test_a_map_with_its_places_is_opened_from_files(open_page):
    page = open_page()
    page.locator('#files').set_input_files(dropped_files())
    expect(page.locator('#map-about')).to_contain_text('0.1 m a cell')
    expect(page.locator('#places')).to_have_text('desk')
    page.locator('#instruction').fill('avoid the desk')
    page.keyboard.press('Enter')
    expect(page.locator('#verdict')).to_contain_text('The instruction is kept')


def test_files_dropped_anywhere_are_opened_and_what_is_none_is_named(open_page):
    page = open_page()
    page.evaluate(
        """(text) => {
            const data = new DataTransfer();
            data.items.add(new File([text], 'desk.geojson'));
            dispatchEvent(new DragEvent('drop', { dataTransfer: data, cancelable: true }));
        }""",
        json.dumps({'type': 'FeatureCollection', 'features': [DESK]}),
    )
    expect(page.locator('#places')).to_contain_text('desk')
    page.locator('#files').set_input_files(
        {'name': 'bad.geojson', 'mimeType': 'text/plain', 'buffer': b'{'}
    )
    expect(page.locator('[data-error=map]')).to_contain_text('bad.geojson: ')


def test_arrow_keys_move_the_start(open_page):
    page = open_page(f'{DEMO}&start=39,18&goal=7,19')
    start = page.locator('[data-handle=start]')
    start.focus()
    page.keyboard.press('ArrowRight')
    page.keyboard.press('Shift+ArrowDown')
    expect(start).to_have_attribute('aria-label', re.compile(r'^Start at 40, 8\.'))


def test_a_via_point_is_added_by_a_click_and_removed_by_a_key(open_page):
    page = open_page(f'{DEMO}&start=39,18&goal=7,19')
    direct = page.locator('#figures').text_content()
    page.get_by_role('button', name='Via point').click()
    box = page.locator('#board canvas').bounding_box()
    page.mouse.click(box['x'] + 0.5 * box['width'], box['y'] + 0.75 * box['height'])
    wait_for_other(page, direct)
    expect(page.locator('#legend')).to_contain_text('via point')
    page.locator('[data-handle="0"]').press('Delete')
    expect(page.locator('[data-handle="0"]')).to_have_count(0)
    expect(page.locator('#legend')).not_to_contain_text('via point')


def test_walls_are_drawn_by_keys(open_page):
    page = open_page(f'{DEMO}&start=39,18&goal=7,19')
    page.get_by_role('button', name='Draw wall').click()
    page.locator('#brush').select_option('1')
    page.locator('#board canvas').focus()
    for key in ('ArrowRight', 'ArrowRight', 'Shift+ArrowDown', ' '):
        page.keyboard.press(key)
    expect(page.locator('#readout')).to_contain_text('41, 8: obstacle')
    expect(page).to_have_url(re.compile(r'walls=ch\.1$'))  # cell 41 + 8 * 51 in base 36


def test_a_drawn_wall_moves_the_path_and_undo_takes_it_back(open_page):
    page = open_page(f'{DEMO}&method=exact_astar&source=none&start=5,5&goal=45,5')
    free = page.locator('#figures').text_content()
    page.get_by_role('button', name='Draw wall').click()
    box = page.locator('#board canvas').bounding_box()
    across = box['x'] + 0.6 * box['width']
    drag(page, (across, box['y'] + 0.7 * box['height']), (across, box['y'] + 0.9 * box['height']))
    wait_for_other(page, free)
    walled = page.locator('#figures').text_content()
    expect(page.locator('#command-note')).to_contain_text('walls')
    expect(page).to_have_url(re.compile('walls='))
    page.keyboard.press('Control+z')
    wait_for_other(page, walled)
    expect(page.get_by_role('button', name='Redo')).to_be_enabled()
    assert without_times(page.locator('#figures').text_content()) == without_times(free)


def without_times(figures):
    return re.sub(r'(Search|Waypoints) \(ms\)[^A-Z]+', '', figures)


def test_a_typed_reply_shows_what_became_of_each_waypoint(open_page):
    page = open_page(f'{DEMO}&start=39,18&goal=7,19')
    page.locator('#source').select_option('reply')
    expect(page.locator('#reply')).to_have_value(re.compile(r'^Generated Path: \[\['))
    page.locator('#reply').fill('Generated Path: [[31, 10], [12, 9], [27, 9], [20, 20], [60, 99]]')
    page.get_by_role('button', name='Use this reply').click()
    shown = page.locator('#waypoints li')
    expect(shown.filter(has_text='(60, 99) out of bounds')).to_be_visible()
    statuses = [re.sub(r'.*\) ', '', text) for text in shown.all_text_contents()]
    assert statuses == ['accepted', 'accepted', 'accepted', 'occupied', 'out of bounds']
    expect(page.locator('#legend')).to_contain_text('waypoint occupied')


def test_an_instruction_shows_the_outcome_of_each_clause(open_page):
    page = open_page('map=instructions/office.yaml&start=20,20&goal=180,100')
    page.locator('#instruction').fill('visit the reception, avoid the open space')
    page.locator('#instruction').press('Enter')
    expect(page.locator('#clauses li')).to_have_count(2)
    expect(page.locator('#clauses .status')).to_have_text(['kept', 'kept'])
    expect(page.locator('#verdict')).to_contain_text('The instruction is kept')


def test_a_question_is_answered_by_a_button(open_page):
    question = 'Did you mean the accounts office by "acounts office"?'
    fragment = (
        'map=instructions/office.yaml&start=20,20&goal=180,100'
        '&instruction=visit the acounts office'
    )
    page = open_page(fragment)
    expect(page.locator('#question')).to_contain_text(question)
    expect(page.locator('#verdict')).to_contain_text('A question first')
    expect(page.locator('#clauses .status')).to_have_text(['unsure'])
    page.get_by_role('button', name='Yes', exact=True).click()
    expect(page.locator('#verdict')).to_contain_text('The instruction is kept')
    expect(page.locator('#question')).to_be_hidden()
    # It is remembered.
    page = open_page(fragment)
    expect(page.locator('#clauses .status')).to_have_text(['kept'])


def test_a_reading_that_is_not_meant_is_not_understood(open_page):
    page = open_page('map=instructions/office.yaml&start=20,20&instruction=avoid the servr room')
    page.get_by_role('button', name='No', exact=True).click()
    expect(page.locator('#clauses .status')).to_have_text(['not understood'])
    expect(page.locator('#question')).to_be_hidden()


def colour_at(page, person, x, y):
    """Return the red, green and blue of the map at a cell of the house."""
    left, top = person.at(x, y)
    box = page.locator('#board canvas').bounding_box()
    script = """([x, y]) => {
        const canvas = document.querySelector('#board canvas');
        const part = canvas.width / canvas.clientWidth;
        return [...canvas.getContext('2d').getImageData(part * x, part * y, 1, 1).data];
    }"""
    return tuple(page.evaluate(script, [left - box['x'], top - box['y']])[:3])


def test_a_question_about_the_path_is_answered_and_the_other_path_drawn(open_page):
    page = open_page(HOUSE)
    page.locator('#why').fill('why not through the green bathroom?')
    page.locator('#why').press('Enter')
    expect(page.locator('#answer')).to_have_text(
        re.compile(r'^through the green bathroom: 15\.2 m instead of 14\.2 m; its narrowest place')
    )
    expect(page.locator('#legend')).to_contain_text('path that was asked about')
    expect(page).to_have_url(re.compile('why=why'))
    expect(page.locator('#command')).to_contain_text('--why=')
    page.locator('#why').fill('why me?')
    page.get_by_role('button', name='Ask', exact=True).click()
    expect(page.locator('#answer')).to_contain_text('is not understood; ask')
    expect(page.locator('#legend')).not_to_contain_text('path that was asked about')


def test_what_closes_the_way_is_named_and_marked(open_page):
    page = open_page(f'{HOUSE}&robot_radius=0.6')
    expect(page.locator('#verdict')).to_contain_text('a radius of 0.499 m passes, at (5.05, 2.45)')
    expect(page.locator('#legend')).to_contain_text('closes the way')
    assert colour_at(page, Person(page), 50, 24) == (200, 16, 46)


def test_ways_to_choose_from_are_listed_and_drawn(open_page):
    page = open_page('map=demo.json:0&start=39,18&goal=7,19')
    expect(page.locator('#ways')).to_be_hidden()
    page.locator('#alternatives').select_option('3')
    expect(page.locator('#ways li')).to_have_count(2)
    expect(page.locator('#ways')).to_contain_text('way 2: 46.7 cells, clearance 1.00 cells, ')
    expect(page.locator('#legend')).to_contain_text('way 2')
    expect(page).to_have_url(re.compile('alternatives=3'))


def test_a_one_way_is_drawn_planned_with_and_saved(open_page):
    page = open_page(HOUSE)
    before = page.locator('.panel.main .figures').text_content()
    person = Person(page)
    person.click('Zone')
    page.locator('#zone-cost').select_option('one_way')
    expect(page.locator('#zone-note')).to_contain_text('Drag a line the way it leads')
    person.drag((70, 58), (70, 44))
    expect(page.locator('#legend')).to_contain_text('one-way')
    expect(page.locator('.panel.main .figures')).not_to_have_text(before)
    page.mouse.move(*person.at(72, 50))
    expect(page.locator('#readout')).to_contain_text('one-way 1 (one-way)')
    page.locator('#zone-cost').select_option('keep_right')
    for point in ((20, 60), (60, 60), (100, 60), (100, 60)):
        person.press_map(*point)
    expect(page.locator('#legend')).to_contain_text('keep-right lane')
    with page.expect_download() as file:
        page.get_by_role('button', name='Save GeoJSON').click()
    features = json.loads(file.value.path().read_text())['features']
    assert [len(one['geometry']['coordinates']) for one in features] == [2, 3]
    assert features[0]['properties'] == {'name': 'one-way 1', 'kind': 'one_way', 'width': 1}


def test_a_link_reproduces_the_view(open_page):
    fragment = (
        f'{DEMO}&start=39,18&goal=7,19&method=guided&source=coarse&max_suboptimality=1.5'
        '&robot_radius=0.5&via=20,5&walls=7s.3.1c.3'
    )
    page = open_page(fragment)
    page.locator('[data-handle=goal]').press('ArrowUp')
    expect(page).to_have_url(re.compile('goal=7,20'))
    expect(page.locator('#main')).to_have_attribute('aria-busy', 'false')
    again = open_page(page.url.split('#')[1])
    for selector in ('#figures', '#legend', '#pair-name'):
        first, second = (one.locator(selector).text_content() for one in (page, again))
        assert without_times(first) == without_times(second)
    for field in ('map', 'method', 'source', 'max_suboptimality', 'robot_radius'):
        assert page.locator(f'#{field}').input_value() == again.locator(f'#{field}').input_value()
    assert again.url == page.url


def test_the_command_is_copied(open_page):
    page = open_page(DEMO, permissions=['clipboard-read', 'clipboard-write'])
    page.get_by_role('button', name='Copy as command').click()
    expect(page.locator('#toast')).to_have_text('The command is copied.')
    copied = page.evaluate('navigator.clipboard.readText()')
    assert copied == page.locator('#command').text_content()
    assert copied.startswith('llm-astar plan --map demo.json')


def test_the_animation_stops_and_goes_on(open_page):
    page = open_page(DEMO)
    total = max(expansions(page))
    page.locator('#scrub').fill('10')
    expect(page.locator('#step')).to_contain_text(f'10 of {total}')
    page.locator('#speed').select_option('4')
    page.get_by_role('button', name='Play').click()
    expect(page.locator('#step')).to_contain_text(f'{total} of {total}')
    expect(page.locator('#play')).to_have_text('Replay')


def test_an_error_of_the_server_stands_beside_its_field(open_page):
    page = open_page(DEMO)
    page.locator('#robot_radius').fill('-1')
    page.locator('#robot_radius').press('Enter')
    expect(page.locator('[data-error=robot_radius]')).to_contain_text('-1')
    expect(page.locator('#robot_radius')).to_have_attribute('aria-invalid', 'true')
    assert ['422' in text for text in open_page.errors] == [True]  # Chromium's own line
    open_page.errors.clear()


def test_foreign_text_is_shown_as_text(open_page):
    def hostile(route):
        reply = route.fetch().json()
        plan = reply['plans'][0]
        plan.update(title=HOSTILE, message=HOSTILE)
        plan['waypoints'] = [3, [3, 3, HOSTILE]]
        clause = {'clause': HOSTILE, 'status': HOSTILE, 'detail': HOSTILE * 1000}
        plan.update(causes=[None, {'name': HOSTILE, 'points': [[3, 3]]}], ways=[{'path': HOSTILE}])
        reading = {'sentence': HOSTILE, 'status': HOSTILE}
        plan['instruction_report'] = {'interpretation': reading, 'clauses': [clause]}
        rules = [{'kind': HOSTILE, 'name': HOSTILE, 'rings': 5, 'arrows': [[1]]}]
        answer = {'sentence': HOSTILE, 'path': HOSTILE}
        route.fulfill(json=reply | {'command': HOSTILE, 'rules': rules, 'answer': answer})

    def hostile_map(route):
        sent = route.fetch().json()
        places = [{'name': HOSTILE, 'polygon': [[5, 5], [9, 5], [9, 9]]}]
        route.fulfill(json=sent | {'name': HOSTILE, 'places': places})

    def stub(page):
        page.route('**/api/plan', hostile)
        page.route('**/api/map*', hostile_map)

    page = open_page(f'{DEMO}&reply={quote(HOSTILE)}&walls=zzzzzzzzz.zzzzzzz&via=1;x', stub)
    for selector in ('#clauses', '#sentence', '#command', '#places', '#answer', '.main .title'):
        expect(page.locator(selector)).to_contain_text('<img src=x')
    assert len(page.locator('#clauses').text_content()) < 2000
    assert page.locator('main img, main script').count() == 0
    assert 'hit' not in page.title()


def test_a_start_that_was_moved_is_said_above_the_map(open_page):
    moved = 'the start (3, 4) is occupied; the path begins at (3, 5), 0.05 m off'

    def warn(route):
        reply = route.fetch().json()
        reply['plans'][0]['warnings'] = [moved]
        route.fulfill(json=reply)

    page = open_page(DEMO, lambda page: page.route('**/api/plan', warn))
    expect(page.locator('#moved')).to_have_text(f'{moved.capitalize()}.')


def test_a_link_to_an_unknown_map_says_so(open_page):
    page = open_page(f'map={quote(HOSTILE)}&start=1,1')
    expect(page.locator('#notice')).to_contain_text('The link names a map that is not here, <img')


def test_a_phone_shows_everything_without_scrolling_sideways(open_page):
    page = open_page(
        'map=instructions/office.yaml&start=20,20&goal=180,100&instruction=avoid the open space',
        viewport={'width': 390, 'height': 844}, has_touch=True, color_scheme='dark',
    )  # fmt: skip
    assert page.evaluate('document.documentElement.scrollWidth') <= 390
    for selector in ('#board canvas', '#controls', '#clauses', '#command'):
        box = page.locator(selector).bounding_box()
        assert box['x'] >= 0
        assert box['x'] + box['width'] <= 390
    # The box and its answer are in sight together, and the map below them.
    for selector in ('#instruction', '#verdict', '#tools'):
        assert page.locator(selector).bounding_box()['y'] < 400


def test_a_running_graph_is_shown_as_its_events_come(open_page, url):
    with urllib.request.urlopen(f'{url}api/map?id=demo.json:0') as answer:  # noqa: S310 - loopback
        sent_map = json.load(answer)
    plan = {
        'path': [[5, 5], [6, 6], [7, 6]], 'found': True,
        'waypoints': [[6, 6, 'accepted']], 'length': 2.41, 'operation': 3,
        'message': HOSTILE,
    }  # fmt: skip
    square = [[5, 5], [9, 5], [9, 9], [5, 9]]
    zones = [
        {'kind': 'area', 'name': 'spill', 'cost': 100, 'rings': [square], 'arrows': []},
        {'kind': 'one_way', 'name': 'east', 'rings': [square], 'arrows': [[[5, 7], [9, 7]]]},
    ]
    events = [('map', sent_map), ('rules', zones), ('plan', plan)]
    events.append(('status', {'message': HOSTILE}))
    body = ''.join(f'event: {name}\ndata: {json.dumps(data)}\n\n' for name, data in events)

    def stub(page):
        page.route(
            '**/api/options',
            lambda route: route.fulfill(json=route.fetch().json() | {'live': True}),
        )
        page.route(
            '**/api/live', lambda route: route.fulfill(content_type='text/event-stream', body=body)
        )

    page = open_page(DEMO, stub)
    page.get_by_role('button', name='Running graph').click()
    expect(page.locator('#verdict')).to_contain_text('Path found')
    expect(page.locator('#report')).to_contain_text('<img src=x')
    expect(page.locator('#report')).to_contain_text('Expansions')
    expect(page.locator('#waypoints')).to_contain_text('(6, 6) accepted')
    expect(page.locator('#legend')).to_contain_text('closed zone')
    expect(page.locator('#legend')).to_contain_text('one-way')
    expect(page.locator('#map')).to_be_hidden()
    expect(page.locator('#instruction')).to_be_hidden()
    page.get_by_role('button', name='Plan here').click()
    expect(page.locator('#figures')).to_be_visible()
