"""The notebook in examples/ runs from beginning to end, and is stored without its outputs."""

import json
import subprocess
import sys
from pathlib import Path

import pytest

NOTEBOOK = Path(__file__).resolve().parents[1] / 'examples' / 'benchmark.ipynb'
EXECUTE = """
import sys
import nbformat
from nbclient import NotebookClient
notebook = nbformat.read(sys.argv[1], as_version=4)
NotebookClient(notebook, timeout=100, kernel_name='python3').execute()
nbformat.write(notebook, sys.argv[2])
"""


def code_cells(path):
    return [cell for cell in json.loads(path.read_text())['cells'] if cell['cell_type'] == 'code']


def test_the_notebook_is_stored_without_outputs():
    for cell in code_cells(NOTEBOOK):
        assert (cell['outputs'], cell['execution_count']) == ([], None)


def test_the_notebook_runs_and_finds_that_a_proof_takes_more_expansions(tmp_path):
    pytest.importorskip('nbclient')
    pytest.importorskip('ipykernel')
    done = tmp_path / 'done.ipynb'
    command = [sys.executable, '-c', EXECUTE, str(NOTEBOOK), str(done)]
    subprocess.run(command, cwd=tmp_path, check=True, capture_output=True, timeout=200)
    outputs = [output for cell in code_cells(done) for output in cell['outputs']]
    assert not [output for output in outputs if output['output_type'] == 'error']
    data = [output['data'] for output in outputs if 'data' in output]
    assert sum('image/png' in item for item in data) == 1
    table, page = (''.join(item['text/markdown']) for item in data if 'text/markdown' in item)
    assert '| guided (ours) | oracle |' in table
    assert page.startswith('# Comparison of runs')
    printed = ''.join(''.join(output.get('text', '')) for output in outputs)
    assert r'\begin{tabular}' in printed
    assert 'guided/oracle: operation is ' in printed
    assert (tmp_path / 'out' / 'notebook' / 'compared' / 'changes.csv').is_file()
