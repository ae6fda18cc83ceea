"""The documentation is short, its links lead somewhere, and its commands exist."""

import ast
import contextlib
import functools
import io
import re
import shlex
from pathlib import Path

import pytest
from llm_astar_planner.cli.main import main

ROOT = Path(__file__).resolve().parents[1]
PAGES = sorted([*ROOT.glob('*.md'), *(ROOT / 'docs').glob('*.md')])
MAY_BE_LONGER = {'guided-search.md', 'reference.md'}
LISTS_WHAT_IS_GONE = {'CHANGELOG.md'}
GROUPS = {'dataset'}  # commands with commands of their own
CODE_BLOCK = re.compile(r'^```.*?^```', re.MULTILINE | re.DOTALL)


def identify(page):
    return page.name


def prose(page):
    return CODE_BLOCK.sub('', page.read_text())


def anchors(page):
    """Return the anchors that GitHub gives to the headings of a page."""
    headings = re.findall(r'^#+ (.*)$', prose(page), re.MULTILINE)
    return {re.sub(r'[^\w\- ]', '', heading.lower()).replace(' ', '-') for heading in headings}


def commands(page):
    """Yield the words behind `llm-astar` of each command in a page's code."""
    blocks = '\n'.join(CODE_BLOCK.findall(page.read_text())).replace('\\\n', ' ')
    for line in [*blocks.splitlines(), *re.findall(r'`([^`\n]+)`', prose(page))]:
        match = re.match(r'[^#]*\bllm-astar ([a-z-].*)', line)
        if match:
            yield shlex.split(re.split(r' [|&>]', match[1])[0], comments=True)


@functools.cache
def options(*command):
    """Return the options in the help of a command, or None if there is no such command."""
    text = io.StringIO()
    with contextlib.redirect_stdout(text), contextlib.redirect_stderr(io.StringIO()):
        try:
            code = main([*command, '--help'])
        except SystemExit as end:
            code = end.code
    return set(re.findall(r'--[a-z][a-z-]*', text.getvalue())) if code == 0 else None


def unknown(words):
    """Return what the command line does not know of the words behind `llm-astar`."""
    known = options(*words[: 2 if words[0] in GROUPS else 1])
    if known is None:
        return words[:2]
    return [word for word in words if word.startswith('--') and word not in known]


@pytest.mark.parametrize('page', PAGES, ids=identify)
def test_a_page_has_at_most_1800_words(page):
    words = len(page.read_text().split())
    assert words <= 1800 or page.name in MAY_BE_LONGER, f'{words} words'


@pytest.mark.parametrize('page', PAGES, ids=identify)
def test_every_link_leads_to_a_file_and_a_heading(page):
    for target in re.findall(r'\]\(([^)\s]+)\)', prose(page)):
        if '://' not in target:
            name, _, anchor = target.partition('#')
            linked = page.parent / name if name else page
            assert linked.exists(), target
            assert not anchor or anchor in anchors(linked), target


@pytest.mark.parametrize('page', [page for page in PAGES if page.name not in LISTS_WHAT_IS_GONE],
                         ids=identify)  # fmt: skip
def test_every_command_and_option_exists(page):
    for words in commands(page):
        assert not unknown(words), ' '.join(words)


def test_an_unknown_command_or_option_is_noticed():
    assert unknown(['no-such-command', '--port', '8080']) == ['no-such-command', '--port']
    assert unknown(['dataset', 'no-such-action']) == ['dataset', 'no-such-action']
    assert unknown(['plan', '--map', 'x.yaml', '--no-such-option']) == ['--no-such-option']


def test_commands_are_found_in_blocks_and_in_sentences():
    found = list(commands(ROOT / 'README.md'))
    assert ['play'] in found
    assert ['watch', '--count', '1'] in found
    assert any('--instruction' in words for words in found), 'a line that continues'


def test_the_files_and_names_in_the_architecture_exist():
    text = (ROOT / 'docs' / 'architecture.md').read_text()
    package = ROOT / 'src' / 'llm_astar_planner'
    adapter = ROOT / 'src' / 'llm_astar_msgs_adapter' / 'llm_astar_msgs_adapter'
    lab = ROOT / 'src' / 'llm_astar_lab' / 'llm_astar_lab'
    folders = (package / package.name, package, adapter, lab, ROOT)
    files = set(re.findall(r'`([\w/]+/\w+\.(?:py|yaml))`', text)) - {
        'cli/NAME.py',
        'instructions/clauses/NAME.py',
        'instructions/verification/NAME.py',
        'commands/NAME.py',
    }
    assert len(files) > 25
    for name in files:
        assert any((folder / name).exists() for folder in folders), name
    code = '\n'.join(path.read_text() for path in (ROOT / 'src').rglob('*.py'))
    for name in set(re.findall(r'`((?:[A-Z]\w+\.)?[A-Za-z]\w{4,})(?:\(.*?\))?`', text)):
        for part in name.split('.'):
            assert re.search(rf'\b{part}\b', code), name


def test_the_page_on_installing_names_all_that_pip_has_to_install_for_colcon():
    page = (ROOT / 'docs' / 'install.md').read_text()
    named = re.search(r'pip install --break-system-packages(.*?)colcon', page, re.DOTALL)[1]
    needed = set()
    for setup in (ROOT / 'src').glob('*/setup.cfg'):
        listed = re.search(r'install_requires =\n(.*?)\n\n', setup.read_text() + '\n', re.DOTALL)[
            1
        ]
        needed |= set(re.findall(r'^    ([a-z0-9_]+)', listed, re.MULTILINE))
    from_apt = {'setuptools', 'pillow', 'pyyaml', 'llm_astar_msgs_adapter', 'llm_astar_planner'}
    # `rosdep install` stands before it; test_dependencies.py checks that it knows these keys.
    for manifest in (ROOT / 'src').glob('*/package.xml'):
        from_apt |= set(re.findall(r'<exec_depend>python3-([a-z0-9]+)', manifest.read_text()))
    assert page.index('rosdep install') < page.index('pip install --break-system-packages')
    assert needed - from_apt <= set(re.findall(r'[a-z][a-z0-9]+', named))


def test_the_table_of_exit_codes_is_that_of_the_help():
    page = (ROOT / 'docs' / 'reference.md').read_text()
    rows = re.search(r'^## Exit codes\n(.*?)^## ', page, re.MULTILINE | re.DOTALL)[1]
    seen = set()
    for row in rows.strip().splitlines()[2:]:
        names, *cells = (cell.strip() for cell in row.strip('|').split('|'))
        listed = {code for code, cell in zip(('0', '1', '2', '3'), cells) if cell}
        for name in re.findall(r'`([a-z_-]+)`', names):
            codes = ' '.join(re.search(r'exit codes: (.*)', help_of(name), re.DOTALL)[1].split())
            said = {*re.findall(r'(?:^|[,;] )([0-3]) ', codes)}
            assert said, name
            assert said <= listed, name
            seen.add(name)
    assert {'plan', 'call', 'bench', 'compare', 'benchmark_node'} <= seen


def help_of(name):
    if name == 'benchmark_node':
        module = ROOT / 'src' / 'llm_astar_lab' / 'llm_astar_lab' / 'nodes' / 'benchmark_node.py'
        return ast.get_docstring(ast.parse(module.read_text()))
    text = io.StringIO()
    with contextlib.redirect_stdout(text), contextlib.suppress(SystemExit):
        main([name, '--help'])
    return text.getvalue()
