"""What the stamp of a map says of the clock of its publisher."""

import pytest
from llm_astar_planner.nodes.common.map_subscription import clock_problem

SECOND = 10**9
TODAY = 1_800_000_000 * SECOND
OTHER = 'its stamp is of another clock than the one of this node; see use_sim_time'


@pytest.mark.parametrize(
    ('stamp', 'now', 'problem'),
    [
        (0, TODAY, None),
        (TODAY, TODAY, None),
        (TODAY - 86_400 * SECOND, TODAY, None),
        (TODAY + SECOND // 4, TODAY, None),
        (TODAY + 90 * SECOND, TODAY, 'its stamp is 90.0 s in the future'),
        (100 * SECOND, TODAY, OTHER),
        (TODAY, 100 * SECOND, OTHER),
        (100 * SECOND, 90 * SECOND, 'its stamp is 10.0 s in the future'),
        (90 * SECOND, 100 * SECOND, None),
        (0, 0, None),
    ],
)
def test_a_stamp_of_the_future_or_of_another_clock_is_said(stamp, now, problem):
    assert clock_problem(stamp, now) == problem
