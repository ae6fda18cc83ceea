"""What a user imports from the package itself."""

import subprocess
import sys

import pytest

import llm_astar_planner


def test_the_public_names_are_these_and_can_be_imported():
    assert llm_astar_planner.__all__ == [
        'CostmapConfig', 'Plan', 'PlanRequest', 'Planner', 'ResultCode', 'WaypointSource',
    ]  # fmt: skip
    for name in llm_astar_planner.__all__:
        assert getattr(llm_astar_planner, name).__name__ == name
    with pytest.raises(AttributeError, match="no attribute 'Planer'"):
        _ = llm_astar_planner.Planer


def test_the_package_itself_imports_neither_numpy_nor_the_searches():
    code = 'import sys, llm_astar_planner; print("numpy" in sys.modules)'
    done = subprocess.run([sys.executable, '-c', code], capture_output=True, text=True, check=True)
    assert done.stdout == 'False\n'
