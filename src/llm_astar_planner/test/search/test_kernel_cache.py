"""numba keeps its kernels where this process can write, and finds those of the installation."""

import os
import runpy
import tempfile
from pathlib import Path

import pytest
from llm_astar_planner.search import kernel_cache
from numba.core import config

LOOP = """
from llm_astar_planner.search.kernel_cache import jit

@jit
def loop():
    return 1
"""


@pytest.fixture
def install(tmp_path, monkeypatch):
    """A package of kernels on a read-only disk, compiled at the installation."""
    kernels = tmp_path / 'installed' / '_kernels'
    (kernels / '__pycache__').mkdir(parents=True)
    (kernels / 'loop.py').write_text(LOOP)
    for name in ('loop.py311.nbi', 'loop.py311.1.nbc', 'other.cpython-311.pyc'):
        (kernels / '__pycache__' / name).write_text(name)
    is_writable = kernel_cache.is_writable
    monkeypatch.setattr(
        kernel_cache,
        'is_writable',
        lambda folder: tmp_path / 'installed' not in folder.parents and is_writable(folder),
    )
    monkeypatch.setattr(kernel_cache, '_CHOSEN', [])
    monkeypatch.setattr(config, 'CACHE_DIR', '')
    monkeypatch.setenv('XDG_CACHE_HOME', str(tmp_path / 'home'))
    return kernels / 'loop.py'


def start(install):
    """Import the kernels as a new process does."""
    kernel_cache.prepare_cache.cache_clear()
    kernel_cache.copy_compiled.cache_clear()
    return runpy.run_path(str(install))['loop']


def copied():
    return sorted(path.name for path in Path(config.CACHE_DIR).glob('_kernels_*/*'))


def test_a_read_only_installation_is_copied_to_the_users_cache(install, tmp_path):
    start(install)
    assert Path(config.CACHE_DIR) == tmp_path / 'home' / 'llm_astar_planner'
    assert copied() == ['loop.py311.1.nbc', 'loop.py311.nbi']
    (newer,) = Path(config.CACHE_DIR).glob('_kernels_*/*.nbi')
    newer.write_text('compiled here')
    start(install)
    assert newer.read_text() == 'compiled here'


def test_without_a_home_a_temporary_folder_of_this_user_is_used_and_named(
    install, tmp_path, monkeypatch, capsys
):
    monkeypatch.setenv('XDG_CACHE_HOME', '/proc/nobody')
    monkeypatch.setattr(tempfile, 'tempdir', str(tmp_path))
    start(install)
    folder = Path(config.CACHE_DIR)
    assert folder.parent == tmp_path
    assert folder.stat().st_mode & 0o077 == 0
    assert copied()
    start(install)
    (said,) = capsys.readouterr().err.splitlines()
    assert f'compiled searches are kept in {folder}' in said
    assert 'NUMBA_CACHE_DIR' in said


def test_a_temporary_folder_that_others_may_write_is_not_trusted(install, tmp_path, monkeypatch):
    monkeypatch.setenv('XDG_CACHE_HOME', '/proc/nobody')
    monkeypatch.setattr(tempfile, 'tempdir', str(tmp_path))
    start(install)
    before = Path(config.CACHE_DIR)
    before.chmod(0o777)
    kernel_cache._CHOSEN.clear()
    config.CACHE_DIR = ''
    start(install)
    assert Path(config.CACHE_DIR) != before


def test_the_users_own_choice_stays(install, tmp_path):
    config.CACHE_DIR = str(tmp_path / 'chosen')
    start(install)
    assert str(tmp_path / 'chosen') == config.CACHE_DIR
    assert not copied()


def test_a_choice_that_cannot_be_written_is_named_once_and_ignored(
    install, tmp_path, monkeypatch, capsys
):
    config.CACHE_DIR = '/proc/nowhere'
    monkeypatch.setenv('NUMBA_CACHE_DIR', '/proc/nowhere')
    start(install)
    start(install)
    assert Path(config.CACHE_DIR) == tmp_path / 'home' / 'llm_astar_planner'
    assert 'NUMBA_CACHE_DIR' not in os.environ
    (said,) = capsys.readouterr().err.splitlines()
    assert said == (
        'llm-astar: warning: NUMBA_CACHE_DIR=/proc/nowhere cannot be written and is ignored'
    )


def test_a_folder_that_numba_can_write_stays_its_own(install, monkeypatch):
    monkeypatch.setattr(kernel_cache, 'is_writable', lambda _: True)
    start(install)
    assert not config.CACHE_DIR
