"""ament's linters, as `colcon test` runs them; ruff checks the same rules without ROS."""

import shutil
from pathlib import Path

import pytest

PACKAGE = Path(__file__).resolve().parents[1]
CODE = [str(PACKAGE / PACKAGE.name), str(PACKAGE / 'launch')]
ABSENT = 'ament_lint comes with ROS, not by pip: ruff checks these rules here'
HEADER = '{copyright}\nSPDX-License-Identifier: Apache-2.0\n'


def linter(name):
    return pytest.importorskip(f'{name}.main', reason=ABSENT).main


def test_flake8_finds_nothing():
    assert linter('ament_flake8')(['--config', str(PACKAGE / 'test' / 'flake8.ini'), *CODE]) == 0


def test_docstrings_follow_pep257():
    # D105: magic methods are documented by the language. D401, D402: as sentences, not by word.
    options = ['--convention', 'pep257', '--add-ignore', 'D105', 'D401', 'D402']
    assert linter('ament_pep257')([*CODE, *options]) == 0


def test_every_file_names_its_copyright_and_its_license(monkeypatch):
    check = linter('ament_copyright')
    from ament_copyright import parser  # noqa: PLC0415
    from ament_copyright.licenses import LicenseEntryPoint  # noqa: PLC0415

    # ament knows the long header of the same licence alone.
    short = LicenseEntryPoint('Apache License 2.0', 'Apache-2.0', [HEADER], [], [])
    monkeypatch.setattr(parser, 'get_licenses', lambda: {'apache2': short})
    assert check(CODE) == 0


def test_package_xml_is_valid():
    check = linter('ament_xmllint')
    if shutil.which('xmllint') is None:
        pytest.skip('there is no xmllint: apt-get install libxml2-utils')
    assert check([str(PACKAGE / 'package.xml')]) == 0
