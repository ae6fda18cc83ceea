"""A table of the report as Markdown and LaTeX."""

import pytest
from benchmark_samples import rows_with
from llm_astar_lab.analysis.statistics import NO_SPREAD, UNKNOWN, Interval, Ratio
from llm_astar_lab.analysis.summary import summarise_run
from llm_astar_lab.report.table import (
    Column,
    Table,
    cell_text,
    latex,
    markdown,
    report_tables,
    texts_of,
    write_tables,
)
from llm_astar_lab.results.folder import ResultsFolder

PERCENT = Column('share (%)', 'percent')


def table_of(heads, rows):
    return Table('some', 'Some', tuple(map(Column, heads)), rows)


def test_percentages_show_their_interval_unless_it_is_a_point():
    assert cell_text(Interval(0.5, 0.4, 0.6), PERCENT) == '50.00 (40.00 to 60.00)'
    assert cell_text(Interval(1.0, 1.0, 1.0), PERCENT) == '100.00'
    assert cell_text(UNKNOWN, PERCENT) == '-'
    assert cell_text(1.5, Column('seconds', 'tenth')) == '1.5'
    assert markdown(table_of(('a', 'b'), [])) == ''


def test_a_column_that_says_the_same_in_every_row_is_a_note():
    rows = [('a', '1', '-', '7'), ('b', '1', '-', '8'), ('c', '-', '-', '9')]
    shown, common = table_of(('name', 'one', 'no', 'all'), rows).without_constants()
    assert texts_of(shown) == (('name', 'all'), [('a', '7'), ('b', '8'), ('c', '9')])
    assert common == 'one 1'
    single = table_of(('name', 'one'), [('a', '1')])
    assert single.without_constants()[0] == single


@pytest.fixture
def described(monkeypatch):
    """Describe a table of its own."""
    heads = {
        'name': ['text', "'no ' ~ of['a.b']"],
        'ratio (%)': ['percent', 'ratio.mean'],
        'worst (%)': ['percent', 'ratio.spread.worst'],
        'cost': ['count', 'cost'],
        'gain': ['percent if known', 'gain'],
        '{} (s)': ['number', 'seconds[{}]'],
    }
    found = {'some': {'title': 'Some', 'columns': heads}}
    monkeypatch.setattr('llm_astar_lab.report.table.DESCRIPTIONS', found)


def test_a_column_says_what_an_item_has_and_a_ratio_that_was_not_measured_is_unknown(described):
    ratio = Ratio(Interval(0.5, 0.4, 0.6), NO_SPREAD)
    items = [{'ratio': ratio, 'of': {'a.b': 1}, 'cost': 2.0}, {'ratio': None, 'of': {'a.b': 3}}]
    table = Table.of('some', items)
    assert texts_of(table)[1] == [
        ('no 1', '50.00 (40.00 to 60.00)', '-', '2'),
        ('no 3', '-', '-', '-'),
    ]
    assert len(table.columns) == 4


def test_a_column_is_there_for_each_name_and_some_only_with_a_value(described):
    items = [{'gain': UNKNOWN, 'seconds': [1, 2]}, {'gain': 0.5, 'seconds': [3]}]
    heads, rows = texts_of(Table.of('some', items, ['a{}', 'b']))
    assert heads[4:] == ('gain', 'a{} (s)', 'b (s)')
    assert [row[4:] for row in rows] == [('-', '1.00', '2.00'), ('50.00', '3.00', '-')]
    assert len(texts_of(Table.of('some', items[:1], ['a']))[0]) == 5


def test_no_cell_breaks_a_table():
    """The name of a model comes from a file or a server."""
    name = 'a|b & 50%_\\$#{}~^<\n\x1b'
    table = table_of(('name', 'other'), [(name, 'x'), ('c', 'y')])
    lines = markdown(table).splitlines()
    assert [line.count('|') - line.count(r'\|') for line in lines] == [3] * 4
    row = next(line for line in latex(table).splitlines() if line.startswith('a'))
    assert row == (
        r'a\textbar{}b \& 50\%\_\textbackslash{}\$\#\{\}\textasciitilde{}'
        r'\textasciicircum{}\textless{} ? & x \\'
    )
    assert r'{}[1pt] & {}*' in latex(table_of(('name', 'other'), [('[1pt]', '*'), ('c', 'y')]))


def test_every_table_of_a_report_is_written_as_latex(tmp_path):
    rows = rows_with(0.8)
    tables = report_tables(summarise_run(rows, {'parameters': {}}))
    files = write_tables(ResultsFolder(tmp_path), tables)
    names = ('main', 'over_none', 'spread', 'waypoints', 'paths', 'paper')
    assert {path.name for path in files} == {f'{name}.tex' for name in names}
    for table in tables:
        heads = [column.head for column in table.columns]
        assert len(set(heads)) == len(heads)
        source = (tmp_path / f'tables/{table.name}.tex').read_text()
        body = source[source.index(r'\toprule') : source.index(r'\bottomrule')]
        lines = [line for line in body.splitlines() if line.endswith(r'\\')]
        assert len(lines) == len(table.rows) + 1
        assert len({line.count(' & ') for line in lines}) == 1
        assert source.isascii() or table.name == 'paper'
