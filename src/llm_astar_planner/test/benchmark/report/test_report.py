"""Reports say what the figures say, losers included, and the page needs no network."""

import json
import math
import re
import shutil
import subprocess
from dataclasses import replace

import numpy as np
import pytest
from llm_astar_msgs_adapter.maps.barrier_map import save_barrier_maps
from llm_astar_msgs_adapter.maps.grid_map import GridMap
from llm_astar_planner.benchmark.analysis.scalability import growth
from llm_astar_planner.benchmark.analysis.statistics import Interval
from llm_astar_planner.benchmark.analysis.summary import (
    PairedComparison,
    Price,
    by_variant,
    compare_with_none,
    report_order,
    summarise,
)
from llm_astar_planner.benchmark.analysis.thresholds import missed_thresholds, parse_threshold
from llm_astar_planner.benchmark.datasets.generate import generate
from llm_astar_planner.benchmark.report.figures import drawable_map
from llm_astar_planner.benchmark.report.html import html_report
from llm_astar_planner.benchmark.report.markdown import markdown_table, percent, replace_section
from llm_astar_planner.benchmark.report.sentences import (
    effect_on,
    growth_sentence,
    headline,
    sentence,
)
from llm_astar_planner.benchmark.report.write import write_report
from llm_astar_planner.benchmark.results import ResultsFolder, Row, Variant, describe_run
from llm_astar_planner.costmap.config import CostmapConfig


def row(variant, operation=100.0, length=30.0, map_id=0, pair=0, scale=1, **values):
    found = {'code': 'NONE', 'operation': operation, 'storage': operation, 'length': length}
    return Row(map_id, pair, scale, *variant, **{**found, **values})


A_STAR, NONE, ORACLE = Variant('astar'), Variant('llm_astar'), Variant('llm_astar', 'oracle')
MODEL = Variant('llm_astar', 'replay', 'few_shot', 'parrot-1')


def rows_with(factor, spread=0.0, variant=ORACLE):
    """Return rows of 20 maps on which waypoints multiply the work by about `factor`."""
    random = np.random.default_rng(0)
    rows = []
    for index in range(40):
        here = {'map_id': index // 2, 'pair': index % 2}
        work = 50.0 * factor * math.exp(spread * random.normal())
        rows += [row(A_STAR, **here), row(NONE, 50.0, **here), row(variant, work, 31.0, **here)]
    return rows


def test_a_grid_is_drawn_with_the_walls_the_planner_had():
    costmap = GridMap(np.array([[0, 70, 99, 100, -1]], dtype=np.int8), 0.05)
    drawn = drawable_map(costmap, CostmapConfig(occupied_threshold=99))
    assert drawn.cells.tolist() == [[0, 0, 100, 100, -1]]


def test_a_summary_holds_each_metric():
    rows = [
        row(A_STAR, 100.0, 10.0),
        row(A_STAR, 100.0, 10.0, pair=1),
        row(A_STAR, 100.0, 10.0, map_id=1),
        row(MODEL, 25.0, 10.0, verdicts='accepted;occupied', waypoints='1,2;3,4', prompt_tokens=9),
        row(MODEL, 100.0, 12.0, pair=1, completion_tokens=1, source_status='TIMEOUT'),
        row(MODEL, 10.0, math.nan, map_id=1, code='NO_VALID_PATH'),
    ]
    summary = summarise(rows, price=Price(1e5, 1e6))[1]
    assert summary.variant == MODEL
    assert (summary.samples, summary.maps, summary.unanswered) == (3, 2, 1)
    assert summary.valid.value == pytest.approx(2 / 3)
    assert summary.operation.mean.value == pytest.approx(0.5)
    assert summary.operation.spread.worst == 1.0
    assert summary.length.mean.value == pytest.approx(math.sqrt(1.2))
    assert summary.optimal == 0.5
    assert summary.verdicts == {'accepted': 0.5, 'occupied': 0.5}
    assert summary.waypoints == pytest.approx(2 / 3)
    assert summary.cost == pytest.approx(0.9 + 1.0)


@pytest.mark.parametrize(
    ('factor', 'spread', 'word', 'start'),
    [
        (0.8, 0.05, 'help', 'The waypoints saved work'),
        (1.3, 0.05, 'harm', 'The waypoints did harm'),
        (1.0, 0.5, 'nothing', 'The waypoints added nothing that can be told from chance'),
    ],
)
def test_the_finding_follows_the_interval(factor, spread, word, start):
    (comparison,) = compare_with_none(rows_with(factor, spread))
    assert effect_on(comparison.operation) == word
    text = sentence(comparison)
    assert text.startswith(start)
    assert '95 % interval' in text
    assert 'over 40 samples of 20 maps' in text


def test_the_sentence_says_help_and_harm_in_numbers():
    comparison = PairedComparison(
        MODEL, 500, 50, Interval(0.8, 0.75, 0.9), Interval(1.01, 0.999, 1.02)
    )
    assert sentence(comparison) == (
        'The waypoints saved work: LLM-A* with the waypoints of `replay` (parrot-1, few_shot) '
        'expanded 20.00 % fewer nodes than with no waypoints (95 % interval: 10.00 to 25.00 % '
        'fewer), on paths 1.00 % longer (95 % interval: 0.10 % shorter to 2.00 % longer), over '
        '500 samples of 50 maps.'
    )


def test_the_headline_is_about_the_model_where_there_is_one():
    rows = rows_with(0.8) + [r for r in rows_with(1.4, variant=MODEL) if r.variant == MODEL]
    assert 'parrot-1' in headline(compare_with_none(rows))
    assert '`oracle`' in headline(compare_with_none(rows_with(0.8)))
    assert 'nothing to compare' in headline([])


def test_variants_are_ordered_as_in_the_paper_with_baselines_below_models():
    alone, guided = Variant('waypoints_only', 'oracle'), Variant('guided')
    variants = [ORACLE, guided, NONE, MODEL, alone, A_STAR]
    assert sorted(variants, key=report_order) == [
        A_STAR, alone, MODEL, NONE, ORACLE, guided,
    ]  # fmt: skip


def test_growth_is_over_the_samples_solved_at_every_scale():
    rows = [row(A_STAR, 10.0 * scale**2, scale=scale) for scale in (1, 2, 4)]
    rows += [row(A_STAR, 1.0, pair=1), row(A_STAR, 99.0, pair=1, scale=2)]
    rows += [row(ORACLE, 7.0 * scale, scale=scale) for scale in (1, 2, 4)]
    area, _, linear, _ = growth(rows)
    assert (area.samples, area.scales, area.factors) == (1, (1, 2, 4), (1.0, 4.0, 16.0))
    assert area.slope == pytest.approx(2.0)
    assert linear.slope == pytest.approx(1.0)
    assert growth_sentence(growth(rows)).endswith(
        'over 1 sample: near linear in the scale, which would be slope 1.'
    )
    assert growth(rows_with(1.0)) == []


def test_thresholds_know_which_way_is_worse():
    summaries = summarise(rows_with(0.8))
    limits = ['llm_astar/oracle:operation=41', 'astar:valid=100', 'llm_astar/oracle:length=104']
    assert missed_thresholds(summaries, [parse_threshold(text) for text in limits]) == []
    tight = ['llm_astar/oracle:operation=39', 'llm_astar/oracle:optimal=50', 'nobody:valid=1']
    lines = missed_thresholds(summaries, [parse_threshold(text) for text in tight])
    assert 'operation 40.00 % is above 39' in lines[0]
    assert 'optimal 0.00 % is below 50' in lines[1]
    assert 'nobody: was not run; available are astar/none' in lines[2]


def test_a_threshold_for_the_beginning_of_names_is_for_all_of_them():
    rows = rows_with(0.8, variant=Variant('llm_astar', 'replay', model='m1'))
    limit = [parse_threshold('llm_astar/replay:operation=1')]
    assert [line.split(':')[0] for line in missed_thresholds(summarise(rows), limit)] == [
        'llm_astar/replay/m1'
    ]


@pytest.mark.parametrize(
    'text', ['', 'a', 'a:operation', 'a:speed=3', 'a:length=fast', ':valid=1']
)
def test_bad_thresholds_are_named(text):
    with pytest.raises(ValueError, match=r'is expected|is not a number'):
        parse_threshold(text)


def test_percentages_show_their_interval_unless_it_is_a_point():
    assert percent(Interval(0.5, 0.4, 0.6)) == '50.00 (40.00 to 60.00)'
    assert percent(Interval(1.0, 1.0, 1.0)) == '100.00'
    assert percent(Interval(math.nan, math.nan, math.nan)) == '-'
    assert markdown_table(['a', 'b'], []) == ''


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
def published(tmp_path_factory):
    """Return a published folder of real maps with a model that writes mischief."""
    path = tmp_path_factory.mktemp('published')
    maps = list(generate(1, 20))
    save_barrier_maps(maps, path / 'maps.json')
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
    summary = write_report(folder, {**metadata, 'seconds': 1.5}, maps)
    return path, summary


def test_publishing_writes_everything_that_is_read(published):
    path, summary = published
    for name in ('summary.json', 'report.md', 'report.html', 'ratios.png', 'showcase.png'):
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


def test_the_page_is_self_contained_and_quotes_what_models_wrote(published):
    page = (published[0] / 'report.html').read_text()
    links = re.findall(r'(?:src|href)="([^"]*)"', page)
    assert links
    assert all(link.startswith('data:image/') for link in links)
    assert '://' not in page.replace('http://www.w3.org/2000/svg', '')
    assert '<script>alert' not in page
    data = json.loads(re.search(r'type="application/json">(.*?)</script>', page, re.DOTALL)[1])
    assert len(data['samples']) == 40
    assert len(data['cases']) == 4


def test_a_report_can_be_written_for_no_rows_at_all():
    page = html_report([], [], [], {}, rows=[], maps=[])
    assert 'nothing to compare' in page
    assert by_variant([]) == {}


@pytest.mark.skipif(shutil.which('chromium') is None, reason='there is no chromium')
def test_the_page_works_in_a_browser_offline(published, tmp_path):
    """The browser of samples draws, lists every case, and no script fails."""
    page = (published[0] / 'report.html').read_text()
    probe = """<script>addEventListener('load', () => {
      document.getElementById('after').click();
      document.querySelectorAll('#rows tr')[3].click();
      document.title = [document.querySelectorAll('#rows tr').length,
        document.querySelectorAll('#board circle').length,
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
