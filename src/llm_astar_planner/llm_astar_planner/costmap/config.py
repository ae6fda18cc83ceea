"""The rules that turn an occupancy grid into a costmap."""

from __future__ import annotations

from dataclasses import dataclass

# Metres; a robot is not larger.
MAX_RADIUS = 10.0


@dataclass(frozen=True)
class CostmapConfig:
    """Where a path may go, and what it costs there.

    `occupied_threshold` is the occupancy that is lethal. `cost_multiplier` is what occupancy
    below it adds to the price of a move, for `guided` and `exact_astar` (Nav2's
    `cost_travel_multiplier`): d * (1 + multiplier * occupancy / 100); 0 counts lengths alone.

    The robot's body, in metres: cells up to `robot_radius` from a lethal one are blocked, and
    from there to `inflation_radius` they cost the more the nearer, decaying by
    `cost_scaling_factor` a metre (Nav2's InflationLayer; the formula is in
    `costmap.inflation`). With both radii 0 the map is taken as it is, which is right for a
    costmap: it is inflated already. A costmap as an occupancy grid has 100 for lethal, 99 for
    inscribed and 1 to 98 for graded cells, so its `occupied_threshold` is 99. Raises ValueError on
    a number out of its range.
    """

    occupied_threshold: int = 65
    allow_unknown: bool = True
    corner_cutting: bool = False
    cost_multiplier: float = 2.0
    robot_radius: float = 0.0
    inflation_radius: float = 0.0
    cost_scaling_factor: float = 10.0

    def __post_init__(self) -> None:
        """Check the numbers."""
        ranges = {
            'occupied_threshold': (1, 100),
            'cost_multiplier': (0.0, 100.0),
            'robot_radius': (0.0, MAX_RADIUS),
            'inflation_radius': (0.0, MAX_RADIUS),
            'cost_scaling_factor': (0.0, 1000.0),
        }
        for name, (least, most) in ranges.items():
            value = getattr(self, name)
            if not least <= value <= most:
                raise ValueError(f'{name}: {value} is not in {least:g} to {most:g}')
