"""Reports have all their files, and the page needs no network."""

import html
import json
import re
import shutil
import subprocess
from dataclasses import replace

import numpy as np
import pytest
from benchmark_samples import ORACLE, rows_with
from llm_astar_lab.analysis.summary import RunSummary, by_variant
from llm_astar_lab.datasets.generate import generate
from llm_astar_lab.pictures.raster import drawable_map
from llm_astar_lab.report.pages import html_report, replace_section, write_report
from llm_astar_lab.report.samples import browser_data, shown_samples
from llm_astar_lab.results.folder import ResultsFolder, describe_run
from llm_astar_lab.results.row import Variant
from llm_astar_msgs_adapter.maps.grid_map import GridMap
from llm_astar_msgs_adapter.maps.problem_maps import save_maps
from llm_astar_planner.costmap.config import CostmapConfig


def test_a_grid_is_drawn_with_the_walls_of_the_planner():
    costmap = GridMap(np.array([[0, 70, 99, 100, -1]], dtype=np.int8), 0.05)
    drawn = drawable_map(costmap, CostmapConfig(occupied_threshold=99))
    assert drawn.cells.tolist() == [[0, 0, 100, 100, -1]]


def test_a_readme_section_is_replaced_and_the_rest_kept(tmp_path):
    path = tmp_path / 'README.md'
    path.write_text('top\n<!-- results:begin -->\nold\n<!-- results:end -->\nend\n')
    replace_section(path, 'new')
    replace_section(path, 'newer\n')
    text = path.read_text()
    assert text == 'top\n<!-- results:begin -->\nnewer\n<!-- results:end -->\nend\n'
    path.write_text('no markers')
    with pytest.raises(ValueError, match='results:begin'):
        replace_section(path, 'new')
    assert path.read_text() == 'no markers'


@pytest.fixture(scope='module')
def reported(tmp_path_factory):
    """Return a results folder with its report; a model in it has script code as its name."""
    path = tmp_path_factory.mktemp('reported')
    maps = list(generate(1, 20))
    save_maps(maps, path / 'maps.json')
    rows = rows_with(0.8)
    nasty = Variant('llm_astar', 'replay', 'few_shot', '</script><script>alert(1)</script>')
    rows += [
        replace(r, model=nasty.model, source='replay', prompt='few_shot', waypoints='3,4;50,60')
        for r in rows
        if r.variant == ORACLE
    ]
    folder = ResultsFolder(path)
    folder.start()
    folder.append(rows)
    metadata = describe_run([path / 'maps.json'], {'seed': 0, 'jobs': 1})
    write_report(folder, {**metadata, 'seconds': 1.5}, maps)
    return path, folder.read_json('summary.json')


def test_a_report_consists_of_all_its_files(reported):
    path, summary = reported
    for name in ('summary.json', 'report.md', 'report.html'):
        assert (path / name).stat().st_size > 500
    assert json.loads((path / 'summary.json').read_text())['headline'] == summary['headline']
    case = summary['cases'][0]
    assert case['case'] == 'astar/none'
    assert case['operation']['value'] == 1.0
    report = (path / 'report.md').read_text()
    assert summary['headline'] in report
    assert '| LLM-A* | none | - | 50.00 | 50.00 |' in report
    assert 'seed 0' in report
    assert '| LLM-A* | LLAMA3 | Few-Shot | 44.59 | 64.02 | 102.47 | 100 |' in report


def test_the_page_is_self_contained_and_quotes_what_models_wrote(reported):
    page = (reported[0] / 'report.html').read_text()
    links = re.findall(r'(?:src|href)="([^"]*)"', page)
    assert all(link.startswith('data:image/') for link in links)
    assert '://' not in page.replace('http://www.w3.org/2000/svg', '')
    assert '<script>alert' not in page
    data = json.loads(re.search(r'type="application/json">(.*?)</script>', page, re.DOTALL)[1])
    assert len(data['samples']) == 40
    assert len(data['cases']) == 4


def test_the_page_begins_with_the_finding_and_a_figure(reported):
    path, summary = reported
    page = (path / 'report.html').read_text()
    body = html.unescape(page[page.index('<body>') :])
    finding = body.index(summary['headline'].replace('`', ''))
    assert finding < body.index('class="bars"') < body.index('<details>')
    assert body.count('</table>') == body.count('</table></div>')
    # Every table is folded, but for the rows of the chosen sample.
    assert body[: body.index('<details>')].count('<table') == 0
    text = re.sub(r'<[^>]*>', ' ', re.sub(r'<script.*?</script>', '', body, flags=re.DOTALL))
    assert not re.search(r'\b(None|nan|NaN|undefined)\b', text)
    assert len(page) < 1_000_000


def test_the_samples_of_a_large_run_are_thinned_out_to_what_a_page_can_hold(monkeypatch):
    rows, maps = rows_with(0.8), list(generate(1, 20))
    monkeypatch.setattr('llm_astar_lab.report.samples.BUDGET', 8_000)
    data = browser_data(shown_samples(rows, maps), maps, None)
    assert len(json.dumps(data, separators=(',', ':'))) <= 8_000
    assert 1 <= len(data['samples']) < data['total'] == 40
    assert set(data['maps']) == {sample[0] for sample in data['samples']}


def test_the_page_fits_the_width_of_a_phone(reported):
    playwright = pytest.importorskip('playwright.sync_api')
    chromium = shutil.which('chromium')
    if chromium is None:
        pytest.skip('there is no chromium')
    unfold = 'document.querySelectorAll("details").forEach(item => { item.open = true; })'
    sizes = """[...document.querySelectorAll('.bar span, figcaption, td')]
      .map(item => parseFloat(getComputedStyle(item).fontSize))"""
    with playwright.sync_playwright() as browsers:
        browser = browsers.chromium.launch(executable_path=chromium, args=['--no-sandbox'])
        page = browser.new_page(viewport={'width': 390, 'height': 800})
        page.goto((reported[0] / 'report.html').as_uri())
        page.evaluate(unfold)
        assert page.evaluate('document.documentElement.scrollWidth') <= 390
        assert min(page.evaluate(sizes)) >= 12
        browser.close()


def test_a_report_can_be_written_without_rows():
    page = html_report(RunSummary())
    assert 'nothing to compare' in page
    assert by_variant([]) == {}


@pytest.mark.skipif(shutil.which('chromium') is None, reason='there is no chromium')
def test_the_page_works_in_a_browser_offline(reported, tmp_path):
    """The browser of samples draws, lists every variant, and no script fails."""
    page = (reported[0] / 'report.html').read_text()
    probe = """<script>addEventListener('load', () => {
      document.getElementById('after').click();
      document.querySelectorAll('#rows tr')[3].click();
      document.title = [document.querySelectorAll('#rows tr').length,
        document.querySelectorAll('#board .mark').length,
        document.getElementById('pair').value].join(' ');
    });</script></body>"""
    path = tmp_path / 'probe.html'
    path.write_text(page.replace('</body>', probe))
    command = [
        'chromium', '--headless', '--no-sandbox', '--disable-gpu', '--virtual-time-budget=2000',
        f'--user-data-dir={tmp_path / "profile"}', '--dump-dom', path.as_uri(),
    ]  # fmt: skip
    done = subprocess.run(command, capture_output=True, text=True, timeout=120, check=True)
    assert re.search(r'<title>4 \d 1</title>', done.stdout)
