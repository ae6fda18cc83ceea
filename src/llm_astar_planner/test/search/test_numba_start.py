"""Setting numba up leaves scipy.linalg, and what numba does with it, as they are."""

import subprocess
import sys

CODE = """
import sys
from llm_astar_planner.search.numba_start import start_numba
start_numba()
assert 'scipy.linalg' not in sys.modules
import numba, numpy
import scipy.linalg
from scipy.linalg import cython_blas
product = numba.njit(lambda matrix: matrix @ matrix)(2.0 * numpy.eye(2))
assert (product == scipy.linalg.inv(numpy.eye(2) / 4.0)).all()
start_numba()
assert scipy.linalg.__file__
"""


def test_linear_algebra_works_as_ever_after_the_start():
    process = subprocess.run([sys.executable, '-c', CODE], capture_output=True, text=True)
    assert process.returncode == 0, process.stderr
