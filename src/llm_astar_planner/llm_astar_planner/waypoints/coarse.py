"""The `coarse` source: the turns of a cheapest route on a coarser map, without any model.

The route is found on tiles of 4 to 16 cells a side, in which parts that do not connect are kept
apart, so it passes wherever the cells connect, through doors of one cell too. It is pulled taut
on the cells themselves.
"""

from __future__ import annotations

import math
import time
from dataclasses import dataclass

from llm_astar_planner.search.coarse import EVERY_NODE, compile_kernels
from llm_astar_planner.waypoints.plugins import SourceContext
from llm_astar_planner.waypoints.source import SourceStatus, WaypointQuery, WaypointReply

# How many nodes are surely expanded in a second.
NODES_A_SECOND = 500_000


def make_coarse(context: SourceContext) -> CoarseSource:
    """Make the source; compiles its searches, so that no query has to."""
    del context
    compile_kernels()
    return CoarseSource()


@dataclass(frozen=True)
class CoarseSource:
    """Answers with the cells at which a cheapest route over the costmap's tiles turns.

    The first query on a map prepares its graph: about as long as an exact search takes. Equal
    queries get equal answers. Thread-safe.
    """

    name: str = 'coarse'

    def waypoints(self, query: WaypointQuery) -> WaypointReply:
        """Return free cells connected to the start; none where the way is straight or missing."""
        begin = time.monotonic()
        graph = query.costmap.coarse_graph
        left = query.time_limit - (time.monotonic() - begin)
        most = EVERY_NODE if left == math.inf else max(0, int(left * NODES_A_SECOND))
        try:
            turns = graph.turns(query.start, query.goal, most)
        except TimeoutError as error:
            return WaypointReply(label=self.name, status=SourceStatus.TIMEOUT, detail=str(error))
        points = () if turns is None else tuple((float(x), float(y)) for x, y in turns)
        status = SourceStatus.OK if points else SourceStatus.NO_WAYPOINTS
        detail = 'no cells connect start and goal' if turns is None else ''
        return WaypointReply(points, label=self.name, status=status, detail=detail)
