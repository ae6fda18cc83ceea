"""What a release takes is there, and what is missing is said."""

import re
import subprocess
from itertools import pairwise
from pathlib import Path

import pytest
import yaml

ROOT = Path(__file__).resolve().parents[1]
WORKFLOWS = sorted((ROOT / '.github' / 'workflows').iterdir())
PACKAGES = ('llm_astar_msgs_adapter', 'llm_astar_planner', 'llm_astar_lab')
HEADER = (
    '# Copyright 2026 The LLM-A* for ROS 2 contributors\n# SPDX-License-Identifier: Apache-2.0\n'
)
# What stands for an address that there is none of yet, and the files that have it.
PLACEHOLDERS = r'git clone REPOSITORY|[\w-]+@llm-astar\.example'
HAVE_ONE = {
    'README.md', 'SECURITY.md', 'docs/release.md',
    *(f'src/{package}/{name}' for package in PACKAGES for name in ('setup.cfg', 'package.xml')),
}  # fmt: skip


@pytest.mark.parametrize('package', PACKAGES)
def test_each_package_has_a_changelog_in_the_form_of_catkin(package):
    lines = (ROOT / 'src' / package / 'CHANGELOG.rst').read_text().splitlines()
    assert lines[1] == f'Changelog for package {package}'
    assert lines[0] == lines[2] == '^' * len(lines[1])
    headings = [line for line, below in pairwise(lines) if re.fullmatch('-+', below)]
    assert headings
    for heading in headings:
        assert re.fullmatch(r'Forthcoming|\d+\.\d+\.\d+ \(\d{4}-\d\d-\d\d\)', heading)
        assert lines[lines.index(heading) + 1] == '-' * len(heading)
    assert any(line.startswith('* ') for line in lines)


@pytest.mark.parametrize('path', WORKFLOWS, ids=lambda path: path.name)
def test_a_workflow_is_sound(path):
    workflow = yaml.safe_load(path.read_text())
    # YAML takes the word `on` for True.
    assert {'name', True, 'permissions', 'jobs'} <= workflow.keys()
    assert workflow['permissions'] == {'contents': 'read'}
    for job in workflow['jobs'].values():
        for step in job['steps']:
            assert ('uses' in step) != ('run' in step)
            for target in re.findall(r'\bmake (\w+)', step.get('run', '')):
                assert re.search(rf'^{target}:', (ROOT / 'Makefile').read_text(), re.MULTILINE)


def test_industrial_ci_builds_all_and_installs_by_pip_what_the_page_on_installing_says():
    workflow = yaml.safe_load((ROOT / '.github' / 'workflows' / 'industrial_ci.yml').read_text())
    (step,) = (step for step in workflow['jobs']['colcon']['steps'] if 'env' in step)
    assert step['env']['TARGET_WORKSPACE'] == 'src'
    by_pip = re.compile(r"pip install --break-system-packages ([\w'<\s\\]+)(?:\ncolcon|$)")
    page = (ROOT / 'docs' / 'install.md').read_text()
    texts = step['env']['AFTER_INSTALL_TARGET_DEPENDENCIES'], page
    asked, said = (by_pip.search(text)[1].replace('\\', '').split() for text in texts)
    assert asked == said


def test_all_places_without_an_address_are_known():
    listed = ['git', 'ls-files', '--cached', '--others', '--exclude-standard']
    try:
        names = subprocess.run(
            listed, cwd=ROOT, capture_output=True, text=True, check=True
        ).stdout.splitlines()
    except (OSError, subprocess.CalledProcessError):
        pytest.skip('not a git checkout')
    found = set()
    for name in names:
        path = ROOT / name
        if (
            path.is_file()
            and not path.is_symlink()
            and path.suffix not in ('.png', '.npz', '.gif')
        ):
            text = path.read_bytes().decode('utf-8', 'ignore')
            if Path(__file__) != path and re.search(PLACEHOLDERS, text):
                found.add(name)
    assert found == HAVE_ONE


def test_the_page_about_releases_says_that_there_is_no_address():
    page = (ROOT / 'docs' / 'release.md').read_text()
    assert '**An address.**' in page
    assert '`REPOSITORY`' in page


def test_every_file_of_the_packages_begins_with_its_copyright_and_licence():
    lacking = []
    for package in PACKAGES:
        folder = ROOT / 'src' / package
        files = (*(folder / package).rglob('*.py'), *folder.glob('launch/*.py'))
        for path in (*files, *folder.glob('scripts/*')):
            text = path.read_text().split('\n', 1)[1] if path.suffix == '' else path.read_text()
            if text and not text.startswith(HEADER):
                lacking.append(str(path))
    assert not lacking, f'begin these with\n{HEADER}'
