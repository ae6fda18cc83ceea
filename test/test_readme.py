"""Every command in README.md and docs/*.md runs, in order, as its reader would run it.

Each page is one shell, in a folder with what a clone has and with the files of PROVIDED; but for
those of STARTED, pages start each command of `llm-astar` once and else call it in this process,
which imports once what each start would import again. A command fails if it prints a traceback or
exits with another code than 0. What cannot run here is in CANNOT_RUN with the reason; what takes
long is shortened by SHORTER.

`pytest -m slow test/test_readme.py` makes a new clone and its environment first, as the README
says, and runs all pages there, nothing shortened; that takes about ten minutes and the network.
"""

import contextlib
import io
import os
import re
import shlex
import shutil
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

import pytest
from llm_astar_planner.cli.main import main
from reader_files import write_movingai, write_transcript

ROOT = Path(__file__).resolve().parents[1]
PAGES = [ROOT / 'README.md', *sorted((ROOT / 'docs').glob('*.md'))]
FENCE = re.compile(r'^```(\w*)\n(.*?)^```$', re.MULTILINE | re.DOTALL)
PROGRAMS = re.compile(r'^(llm-astar|ros2|make|pip|python|git|docker|export|\. )\b', re.MULTILINE)
BAG = ROOT / 'test' / 'data' / 'version_0_1_0'

# The commands that do not run, by how they begin, and why.
CANNOT_RUN = {
    r'git clone|sudo apt-get|make install|\. \.venv': 'the checkout and its environment are here',
    r'make train|\.venv/bin/|PYTHONPATH=training|cp out/(training|reader)': 'hours of training',
    r'pip install': 'installs packages',
    r'llm-astar plan --source sidestep': 'needs what pip installs; test_plugins.py installs it',
    r'make dist|twine|bloom-release|catkin_': 'publishes; test_dist.py builds what is published',
    r'docker ': 'no Docker here; test_dockerfile.py looks at the Dockerfile',
    r'rosdep|colcon|\. install/setup.bash|ros2 |rviz2 ': 'needs a sourced ROS',
    r'export \w+_API_KEY|llm-astar .*(llm_openai|--source endpoint)': 'needs a key',
    r'llm-astar bench .*qwen.jsonl': 'needs recorded replies; test_recorded_replies.py runs it',
    r'ollama|llama-server': 'needs a server of language models',
    r'(LLM_ASTAR_JUDGE_ALL=1 )?python -m pytest': 'is what runs this',
    r'python docs/make_play_picture': 'needs chromium; test_play_page.py looks at the page',
    r'llm-astar play': 'runs until Ctrl-C; test_play_page.py opens it',
    r'llm-astar watch(?!.*--count)': 'runs until Ctrl-C; test_watch.py runs it',
    r'llm-astar (watch|instruct-bench) .*jq': 'needs jq',
    r'llm-astar evaluate .*/global_costmap/costmap': 'needs the bag of a Nav2 stack',
    r'llm-astar instruct-bench .*house': 'needs a suite of the reader',
    r'llm-astar .*/nav2_bringup/maps/': "needs Nav2's map, which comes with ROS",
    r'llm-astar record': 'runs until Ctrl-C; test_recording.py runs it',
    r'python -m benchmarks': 'minutes, and needs maps from elsewhere',
    r'python -m nav2_stack': 'needs a whole Nav2; test_nav2_missions.py drives where there is one',
}
# Files that no clone has, by what a command calls them, and whose they are.
PROVIDED = {
    r'x\.map': 'downloaded from MovingAI',
    r'--path movingai': 'downloaded from MovingAI',
    r'environment_50_30\.json': "the paper's own file",
    r'replies\.jsonl': 'recorded by `transcript` or by `--record`',
    r'(evaluate|report) run1': 'recorded by the line before it',
    r'evaluate drive': "the user's own recordings",
}
# Blocks of Python that cannot run, by page and first line, and why.
FRAGMENTS = {
    ('guided-search.md', 'grid = GridGraph'): 'a fragment of the planner itself',
    ('nav2-setup.md', 'parts = '): 'a launch file needs a sourced ROS',
    ('nav2-setup.md', 'share = '): 'a launch file needs a sourced ROS',
}
# What only the slow variant runs, and where else it is run, much smaller.
SLOW = {
    r'llm-astar bench .*--(scales|fail-under|map |source emb)': 'test_bench.py, test_grids.py',
    r'llm-astar bench --dataset (paper|movingai|barriers|rooms )': 'test_named.py, test_grids.py',
    r'llm-astar bench --format parquet .*--resume': 'test_large_runs.py',
    r'llm-astar bench --source llm_astar_example': 'test_plugins.py',
    r'llm-astar report out/bench +#': 'test_bench.py',
    r'llm-astar draw .*(searches.gif|both.png)': 'benchmark.md draws the same',
    r'llm-astar run .*demo.yaml|llm-astar call .*(19$|7.0 3.0|--interpret)': 'README.md calls',
    r'llm-astar evaluate .*(guided |out/drive|methods llm_astar)': 'test_evaluate.py',
    r'llm-astar instruct-bench': 'test_instruct_bench.py',
}
# What asks a running planner; a page that starts none takes one for granted.
ASKS = re.compile(r'llm-astar (call|param|watch)')
# Options that are added to the commands that match, so that they end in seconds.
SHORTER = {
    r'llm-astar bench --dataset rooms,': '--limit 3 --methods guided --maps 1',
    r'llm-astar bench': '--limit 3 --methods guided',
    r'llm-astar dataset to-bag': '--map-ids 50-51',
    r'llm-astar dataset generate .*large': '--size 900 600',
}
# What a reader begins with, and a page that changes the shell itself.
STARTED = {'README.md', 'plugins.md'}
SECONDS = 900


def identify(page):
    return page.name


@dataclass(frozen=True)
class Command:
    """One command of a page: its shell text, or a block of Python, and what was written."""

    page: str
    written: str
    script: str

    def __str__(self):
        return f'{self.page}: {self.written.splitlines()[0]}'


def shell_commands(block):
    """Yield the commands of a block, each with the lines that continue it."""
    text = ''
    for line in block.splitlines():
        text = f'{text}\n{line}' if text else line.strip()
        try:
            words = shlex.split(text.replace('\\\n', ' '), comments=True)
        except ValueError:  # a quotation goes on
            continue
        if not text.endswith('\\'):
            if words:
                yield text
            text = ''
    assert not text, text


def commands(page):
    """Return the commands of a page in order."""
    found = []
    for language, block in FENCE.findall(page.read_text()):
        if language == 'sh':
            found += [Command(page.name, text, text) for text in shell_commands(block)]
        elif language == 'python':
            script = f"python - <<'PYTHON'\n{block}PYTHON"
            found.append(Command(page.name, block.strip(), script))
    return found


def reason_not_to_run(command, slow=False):
    """Return why a command cannot run here, None if it can."""
    for (page, start), reason in FRAGMENTS.items():
        if page == command.page and command.written.startswith(start):
            return reason
    reasons = CANNOT_RUN if slow else CANNOT_RUN | SLOW
    return next((why for start, why in reasons.items() if re.match(start, command.written)), None)


def shortened(command):
    """Return a command's script, with options that end it in seconds."""
    for pattern, options in SHORTER.items():
        if re.match(pattern, command.written):
            return f'{re.sub(r" +#.*", "", command.script)} {options}'
    return command.script


def write_files(folder):
    """Write what a reader has: the clone's folders, maps, a transcript, and bags of drives."""
    for name in ('config', 'maps', 'benchmarks', 'examples'):
        (folder / name).symlink_to(ROOT / name)
    shutil.copytree(ROOT / 'docs', folder / 'docs', ignore=shutil.ignore_patterns('images'))
    write_movingai(folder)
    (folder / 'movingai').mkdir()
    write_movingai(folder / 'movingai')
    (folder / 'environment_50_30.json').symlink_to(ROOT / 'maps' / 'samples_1000.json')
    write_transcript(folder / 'replies.jsonl')
    (folder / 'drives').mkdir()
    for name in ('run1', 'drive', 'drives/depot'):
        (folder / name).mkdir()
        shutil.copy(BAG / 'recorded.mcap', folder / name)


def run_page(page, folder, programs, domain=1, slow=False):
    """Run the commands of a page in one shell; return what each printed, and its exit code.

    `programs` is the folder of python and llm-astar; `domain` is that of ROS.
    """
    todo = [one for one in commands(page) if not reason_not_to_run(one, slow)]
    if not todo:
        return []
    write_files(folder)
    steps = folder / 'steps'
    steps.mkdir()
    lines = ["trap 'kill $(jobs -p) 2>/dev/null; wait' EXIT"]
    asks = any(ASKS.match(one.script) for one in todo)
    if asks and not any(one.script.startswith('llm-astar run') for one in todo):
        lines.append('llm-astar run >run.txt 2>&1 &')
    for number, command in enumerate(todo):
        step = steps / str(number)
        step.write_text((command.script if slow else shortened(command)) + '\n')
        lines.append(f'. {step} </dev/null >{step}.out 2>&1; echo $? >{step}.code')
    (steps / 'all').write_text('\n'.join(lines) + '\n')
    path = f'{programs}{os.pathsep}{os.environ["PATH"]}'
    environment = os.environ | {'PATH': path, 'ROS_DOMAIN_ID': str(domain)}
    if slow:
        environment.pop('PYTHONPATH', None)
    shell = subprocess.Popen(['/bin/bash', 'steps/all'], cwd=folder, env=environment)
    try:
        shell.wait(SECONDS * (4 if slow else 1))
    except subprocess.TimeoutExpired:
        shell.terminate()
        shell.wait(20)
    return [(command, *outcome(steps / str(number))) for number, command in enumerate(todo)]


def call_page(page, folder, programs, begun):
    """Run the commands of a page as run_page does, in this process those that had begun."""
    write_files(folder)
    todo = [one for one in commands(page) if not reason_not_to_run(one)]
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        patch.setenv('PATH', str(programs), prepend=os.pathsep)
        return [(command, *call(shortened(command), begun)) for command in todo]


def call(script, begun):
    """Run one command in the working folder; return its exit code and what it printed.

    One of llm-astar that is among those that had begun is called in this process.
    """
    words = shlex.shlex(script.replace('\\\n', ' '), posix=True, punctuation_chars=True)
    words.whitespace_split = True
    name, *options = words
    if name != 'llm-astar' or {'|', '||', '<<'} & {*options} or options[0] not in begun:
        begun.update(options[:1])
        done = subprocess.run(
            ['/bin/bash', '-c', script], stdin=subprocess.DEVNULL, stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT, text=True,
        )  # fmt: skip
        return done.returncode, done.stdout
    printed = io.StringIO()
    with contextlib.redirect_stdout(printed), contextlib.redirect_stderr(printed):
        return main(options), printed.getvalue()


def outcome(step):
    """Return the exit code of a step, None if it did not end, and what it printed."""
    code, printed = Path(f'{step}.code'), Path(f'{step}.out')
    return (
        int(code.read_text()) if code.exists() else None,
        printed.read_text() if printed.exists() else '',
    )


def problem(command, code, printed):
    """Return what is wrong with how a command ended, None for nothing."""
    if code is None:
        return f'{command}\ndid not end within {SECONDS} s:\n{printed}'
    if 'Traceback (most recent call last)' in printed:
        return f'{command}\nprints a traceback:\n{printed}'
    return None if code == 0 else f'{command}\nexits with {code}:\n{printed}'


def run_pages(tmp_path_factory, programs, slow=False):
    """Run all pages, two at a time, each in a ROS domain of its own; return outcomes by page."""

    # Made here: the first folder of two threads at once would delete the other's.
    folders = {page: tmp_path_factory.mktemp(page.stem) for page in PAGES}

    def run(page):
        domain = 1 + (os.getpid() + PAGES.index(page)) % 39
        return run_page(page, folders[page], programs, domain, slow)

    started = [page for page in PAGES if slow or page.name in STARTED]
    with ThreadPoolExecutor(2 if slow else 1) as pool:
        ran = pool.map(run, started)
        begun = set()
        called = {
            page.name: call_page(page, folders[page], programs, begun)
            for page in PAGES
            if page not in started
        }
        return called | dict(zip([page.name for page in started], ran))


@pytest.fixture(scope='module')
def outcomes(tmp_path_factory):
    return run_pages(tmp_path_factory, Path(sys.executable).parent)


@pytest.fixture(scope='module')
def outcomes_in_a_clone(tmp_path_factory):
    clone = tmp_path_factory.mktemp('clone') / 'llm-astar'
    environment = {name: value for name, value in os.environ.items() if name != 'PYTHONPATH'}
    for command in (
        ['git', 'clone', '--quiet', ROOT, clone],
        ['make', '-C', clone, 'install'],
    ):
        subprocess.run(command, check=True, env=environment)
    return run_pages(tmp_path_factory, clone / '.venv' / 'bin', slow=True)


@pytest.mark.timeout(1200)
@pytest.mark.parametrize('page', PAGES, ids=identify)
def test_every_command_of_a_page_runs(page, outcomes):
    problems = [problem(*outcome) for outcome in outcomes[page.name]]
    assert not any(problems), '\n\n'.join(filter(None, problems))


def test_the_output_that_the_readme_shows_is_what_its_commands_print(outcomes):
    printed = {line for *_, text in outcomes['README.md'] for line in text.splitlines()}
    (shown,) = (block for language, block in FENCE.findall(PAGES[0].read_text()) if not language)
    assert len(shown.splitlines()) > 3
    assert {*shown.splitlines()} <= printed


@pytest.mark.slow
@pytest.mark.timeout(3600)
@pytest.mark.parametrize('page', PAGES, ids=identify)
def test_every_command_of_a_page_runs_in_a_new_clone(page, outcomes_in_a_clone):
    test_every_command_of_a_page_runs(page, outcomes_in_a_clone)


@pytest.mark.parametrize('page', PAGES, ids=identify)
def test_every_block_of_commands_says_sh(page):
    for language, block in FENCE.findall(page.read_text()):
        assert language or not PROGRAMS.search(block), block


def test_most_commands_run_and_each_reason_is_needed():
    every = [command for page in PAGES for command in commands(page)]
    ran = [command for command in every if not reason_not_to_run(command)]
    assert len(ran) >= 30
    assert {'README.md', 'benchmark.md', 'bags.md', 'robot.md'} <= {c.page for c in ran}
    for start in CANNOT_RUN | SLOW:
        assert any(re.match(start, command.written) for command in every), start
    for name in PROVIDED:
        assert any(re.search(name, command.written) for command in every), name
    for page, start in FRAGMENTS:
        assert any(c.page == page and c.written.startswith(start) for c in every), start


def test_a_command_that_fails_is_noticed(tmp_path):
    page = tmp_path / 'page.md'
    page.write_text(
        '```sh\nllm-astar plan --no-such-option\necho fine   # a comment\n'
        'python -c "raise \\\nSystemExit(3)"\n```\n```python\n1 / 0\n```\n'
    )
    folder = tmp_path / 'folder'
    folder.mkdir()
    ran = run_page(page, folder, Path(sys.executable).parent)
    assert [code for _, code, _ in ran] == [2, 0, 3, 1]
    problems = [problem(*outcome) for outcome in ran]
    assert 'exits with 2' in problems[0]
    assert problems[1] is None
    assert 'exits with 3' in problems[2]
    assert 'traceback' in problems[3]
