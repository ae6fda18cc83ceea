"""Hold the figures of README.md and docs/ to what measured them.

`docs/figures.json` has every figure by page and section, with the source that it comes from: its
command, the commit and the machine. A figure that is not there, or is no longer on the page, is a
problem, and so are pages that quote different figures. `--measure` also runs the commands whose
counts repeat on every machine, in about ten minutes, and looks for what they print in the pages.
`--record SOURCE` takes a page's figures into the file again, after SOURCE was measured.
"""

from __future__ import annotations

import argparse
import json
import os
import re
import subprocess
import sys
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from decimal import ROUND_HALF_UP, Decimal
from pathlib import Path
from typing import Any

from llm_astar_lab.results.folder import describe_machine

ROOT = Path(__file__).resolve().parents[1]
LEDGER = ROOT / 'docs' / 'figures.json'
PAGES = ('README.md', *sorted(f'docs/{path.name}' for path in (ROOT / 'docs').glob('*.md')))
# Decimals, thousands, and whole numbers with a unit; code and links hold settings and names.
FIGURE = re.compile(
    r'(?<![\w.,/])(?:\d{1,3}(?:,\d{3})+(?:\.\d+)?|\d*\.\d+(?![\w.])'
    r'|\d+(?= ?(?:%|(?:ms|µs|s|seconds|minutes|times|[MGK]i?B)\b)))'
)
NOT_TEXT = re.compile(r'```.*?```|`[^`\n]*`|\]\([^)]*\)', re.DOTALL)
Expected = Iterator[tuple[str, str]]
Figures = dict[str, dict[str, str]]
METHODS = {'A*': 'astar', 'LLM-A*': 'llm_astar', 'guided (ours)': 'guided'}
YARD = '--robot-radius 2 --inflation-radius 10 --cost-scaling-factor 0.2'


def main(arguments: Sequence[str] | None = None) -> int:
    """Check or record; print the problems and return 1 where there are any."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--measure', action='store_true', help='run the commands, too')
    parser.add_argument('--out', type=Path, default=ROOT / 'out' / 'figures')
    parser.add_argument('--record', nargs='+', metavar='SOURCE', help='sources measured just now')
    options = parser.parse_args(arguments)
    ledger = json.loads(LEDGER.read_text(encoding='utf-8'))
    if options.record:
        record(ledger, options.record)
    problems = [*ledger_problems(ledger, figures()), *missing(quoted())]
    if options.measure:
        problems += missing(measured(options.out))
    print(*problems, f'{len(problems)} problems', sep='\n')
    return 1 if problems else 0


def figures() -> Figures:
    """Return the figures of each page by its sections, as they are written."""
    found: Figures = {}
    for page in PAGES:
        text = NOT_TEXT.sub('', (ROOT / page).read_text(encoding='utf-8'))
        for section in re.split(r'^#+ ', f'{text}\n', flags=re.MULTILINE)[1:]:
            head, _, body = section.partition('\n')
            if numbers := ' '.join(FIGURE.findall(body)):
                found.setdefault(page, {})[head] = numbers
    return found


def ledger_problems(ledger: Mapping[str, Any], found: Figures) -> Iterator[str]:
    """Yield what pages have that the ledger has not, and the other way round."""
    for page in found.keys() | ledger['pages'].keys():
        held = ledger['pages'].get(page, {})
        now = found.get(page, {})
        for section in now.keys() | held.keys():
            entry = held.get(section, {'figures': '', 'source': 'settings'})
            if entry['source'] not in ledger['sources']:
                yield f'{page}, {section}: no source is called {entry["source"]}'
            new, old = (Counter(text.split()) for text in (now.get(section, ''), entry['figures']))
            for text, counts in (('is not recorded', new - old), ('is not there', old - new)):
                for figure in counts:
                    yield f'{page}, {section}: {figure} {text} in {LEDGER.name}'


def record(ledger: dict[str, Any], sources: Sequence[str]) -> None:
    """Take the figures of all pages into the ledger; `sources` were measured at this commit."""
    commit = command('git', 'rev-parse', '--short', 'HEAD')
    machine = describe_machine()
    for name in sources:
        ledger['sources'][name] |= {'commit': commit, 'machine': machine}
    ledger['pages'] = {
        page: {
            head: {
                'source': ledger['pages'].get(page, {}).get(head, {}).get('source', sources[0]),
                'figures': numbers,
            }
            for head, numbers in of_page.items()
        }
        for page, of_page in figures().items()
    }
    LEDGER.write_text(json.dumps(ledger, indent=1, ensure_ascii=False) + '\n', encoding='utf-8')


def missing(expected: Expected) -> Iterator[str]:
    """Yield which expected texts a page does not have, whatever its line breaks and bold type."""
    for page, words in expected:
        text = re.sub(r'\*\*|`', '', (ROOT / page).read_text(encoding='utf-8'))
        if words not in ' '.join(text.split()):
            yield f'{page}: does not say: {words}'


def shorter(figure: str, digits: str) -> str:
    """Round a figure as it is written to the digits of another, such as `0.1`."""
    return str(Decimal(figure).quantize(Decimal(digits), ROUND_HALF_UP))


def table(page: str, first: str) -> list[list[str]]:
    """Return the cells of a page's table whose first head begins with `first`, heads first."""
    text = (ROOT / page).read_text(encoding='utf-8')
    block = text[text.index(f'\n| {first}') :].strip().partition('\n\n')[0]
    lines = [line.strip('| ').split(' | ') for line in block.splitlines()]
    return [
        [cell.replace('**', '').strip(' `') for cell in line]
        for line in lines
        if not line[0].startswith('--')
    ]


def quoted() -> Expected:
    """Yield what pages must say because another page has the figures in full."""
    results = {
        (METHODS.get(cells[0], ''), cells[1].partition(' ')[0]): [c.split(' ')[0] for c in cells]
        for cells in table('docs/results.md', 'Methodology')
    }
    for method, source in [
        *((m, s) for m in ('llm_astar', 'guided') for s in ('none', 'embedded', 'random'))
    ]:
        cells = results[method, source]
        yield 'README.md', f'{cells[3]} | {cells[5]} |'
    work = ' | '.join(
        ' / '.join(
            shorter(results[method, source][3], '0.1')
            for source in ('none', 'embedded', 'embedded-best-of-8', 'oracle')
        )
        for method in ('llm_astar', 'guided')
    )
    yield 'docs/embedded-model.md', f'| {work} |'
    for page in ('README.md', 'docs/benchmark.md', 'docs/language-models.md'):
        for interval in ('(1.54 to 2.62)', '(2.34 to 4.08)'):
            yield page, interval
    every = {
        cells[0]: cells[6].split()[0] for cells in table('docs/datasets.md', 'LLM-A* with')[1:]
    }
    own, none, coarse = (
        shorter(every[name], '1') for name in ('embedded', 'no waypoints', 'coarse')
    )
    text = f"{own} % of A*'s nodes with it, {none} % with none and {coarse} % with coarse"
    yield 'README.md', text
    for cells in table('docs/examples.md', 'pair')[1:]:
        if cells[1] in ('none', 'embedded') and cells[0] == '3':
            yield 'README.md', cells[2]


def command(*words: str, **environment: str) -> str:
    """Run a command in the checkout and return what it printed."""
    done = subprocess.run(  # noqa: S603 - our own commands
        words, cwd=ROOT, capture_output=True, text=True, check=True, env=os.environ | environment
    )
    return done.stdout.strip()


def run(*words: str | Path) -> str:
    """Run a module of ours and return what it printed."""
    path = f'{ROOT}/training:{ROOT}:{os.environ.get("PYTHONPATH", "")}'
    return command(sys.executable, '-W', 'ignore', '-m', *map(str, words), PYTHONPATH=path)


def llm_astar(*words: str | Path) -> str:
    """Run `llm-astar` and return what it printed."""
    return run('llm_astar_planner.cli', *words)


def measured(out: Path) -> Expected:
    """Measure, and yield what the pages must say then."""
    out.mkdir(parents=True, exist_ok=True)
    yield from bench_rows(out)
    yield from growth_rows(out)
    yield from family_rows(out)
    yield from example_rows(out)
    yield from embedded_rows()
    if 'LLM_ASTAR_REFERENCE' in os.environ:
        yield from guided_rows()


def bench_rows(out: Path) -> Expected:
    """Yield the table of our 1000 samples."""
    section = out / 'section.md'
    section.write_text('<!-- results:begin -->\n<!-- results:end -->\n', encoding='utf-8')
    llm_astar('bench', '--out', out / 'bench', '--overwrite')
    llm_astar('report', out / 'bench', '--readme', section)
    for line in section.read_text(encoding='utf-8').splitlines():
        if line.startswith(('| ', 'The waypoints')):
            yield 'docs/results.md', line.replace('`', '')


def growth_rows(out: Path) -> Expected:
    """Yield the slopes of growth with the map."""
    llm_astar(
        'bench', '--limit', '100', '--scales', '1-10', '--scale-samples', '100', '--source',
        'oracle', '--methods', 'astar,exact_astar,llm_astar,guided', '--out', out / 'growth',
        '--overwrite',
    )  # fmt: skip
    found = json.loads((out / 'growth' / 'summary.json').read_text(encoding='utf-8'))['growth']
    slopes = {(item['case'], item['quantity']): f'{item["slope"]:.2f}' for item in found}
    cases = (
        'astar/none', 'exact_astar/none', 'llm_astar/none', 'llm_astar/oracle', 'guided/none',
        'guided/oracle',
    )  # fmt: skip
    for quantity in ('operation', 'storage'):
        line = ' | '.join(slopes[case, quantity] for case in cases)
        yield 'docs/results.md', f'| {quantity} | {line} |'


def family_rows(out: Path) -> Expected:
    """Yield the table by family of maps."""
    llm_astar(
        'bench', '--dataset', 'barriers,rooms,mazes,aisles,floors', '--maps', '20', '--pairs', '5',
        '--seed', '1', '--source', 'embedded,coarse', '--out', out / 'families', '--overwrite',
    )  # fmt: skip
    cases = json.loads((out / 'families' / 'summary.json').read_text(encoding='utf-8'))['cases']
    for item in cases:
        if item['method'] == 'llm_astar' and item['source'] in FAMILY_ROWS:
            parts = [
                f'{100 * part["operation"]["value"]:.1f}' for part in item['families'].values()
            ]
            means = item['family_means']
            for mean in (means['every'], means['without']['barriers']):
                value, low, high = (100 * mean[name] for name in ('value', 'low', 'high'))
                parts.append(f'{value:.1f} ({low:.1f} to {high:.1f})')
            yield 'docs/datasets.md', f'| {FAMILY_ROWS[item["source"]]} | {" | ".join(parts)} |'


FAMILY_ROWS = {
    'none': 'no waypoints', 'coarse': 'coarse', 'embedded': 'embedded, greedy',
    'embedded-best-of-8': 'embedded',
}  # fmt: skip


def example_rows(out: Path) -> Expected:
    """Yield the rows of the yard in docs/examples.md."""
    large = out / 'large.json'
    size = ('--size', '2000', '1200', '--maps', '1', '--pairs', '4', '--seed', '3')
    llm_astar('dataset', 'generate', *size, '--out', large)
    for pair, source in [(p, s) for p in '32' for s in ('none', 'coarse', 'embedded')]:
        words = [*YARD.split(), '--map', str(large), '--pair', pair, '--source', source, '--json']
        plan = json.loads(llm_astar('plan', *words))
        figure = f'{plan["operation"]:,} | {plan["length"]:.2f} | {plan["ratio"]:.4f} |'
        yield 'docs/examples.md', f'{source} | {figure}'
    words = [*YARD.split(), '--map', str(large), '--pair', '3', '--source', 'none', '--json']
    plan = json.loads(llm_astar('plan', *words, '--method', 'astar'))
    yield 'docs/examples.md', f'| {plan["operation"]:,} | {plan["length"]:.2f} |'


def embedded_rows() -> Expected:
    """Yield the rows of the model card that need no maps from elsewhere."""
    names = {'samples_1000': 'our 1000 samples'}
    for line in run('llm_astar_training.evaluate').partition('\n\n')[0].splitlines()[2:]:
        cells = line.strip('| ').split(' | ')
        name = names.get(cells[0], cells[0])
        if name in ('our 1000 samples', '101 x 61, 30 barriers', 'samples at scale 10'):
            yield 'docs/embedded-model.md', f'| {" | ".join([name, *cells[1:5]])} |'


def guided_rows() -> Expected:
    """Yield the figures of docs/guided-search.md."""
    for line in run('benchmarks.guided_search').splitlines()[1:]:
        numbers = re.findall(r'\d+\.\d+', line)[-11:]
        if not re.match(r'within 1.1 +none|no landmarks (rev|rand)|no l., 1.1 +[^o]', line):
            yield 'docs/guided-search.md', ' | '.join(numbers)
    slopes = re.findall(r'\d\.\d\d', run('benchmarks.guided_search', '--growth'))
    text = 'our A* expansions {}, storage {}; guided {} and {}; guided without landmarks {} and {}'
    yield 'docs/guided-search.md', text.format(*slopes)


if __name__ == '__main__':
    sys.exit(main())
