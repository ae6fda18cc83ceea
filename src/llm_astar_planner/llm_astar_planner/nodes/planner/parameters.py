"""The parameters of planner_node, and what the core takes of them."""

from __future__ import annotations

from typing import Any

from llm_astar_planner.costmap.config import MAX_RADIUS, CostmapConfig
from llm_astar_planner.nodes.common.parameters import Parameter, Parameters
from llm_astar_planner.nodes.planner.instruction import instruction_problem
from llm_astar_planner.nodes.planner.introspection import INTROSPECTION_MODE
from llm_astar_planner.planning import parameters as planner_options
from llm_astar_planner.search.paper import GUIDED, HEURISTICS, METHODS

SEARCH = (
    Parameter('method', GUIDED, 'How to search', choices=tuple(METHODS)),
    Parameter(
        'max_suboptimality',
        1.1,
        'What guided proves its path within, 1 or more; 0: the first path found',
        minimum=0.0,
        maximum=1000.0,
    ),
    Parameter(
        'search_while_waiting',
        True,
        'Whether guided starts, after 30 ms, before the waypoints are there',
    ),
    Parameter('any_angle', False, 'Whether the plan is shortened at any angle'),
    Parameter(
        'heuristic',
        'euclidean',
        "The paper's methods' estimate of what is left",
        choices=tuple(HEURISTICS),
    ),
    Parameter('weight', 2.0, "weighted_astar's weight of h", minimum=1.0, maximum=100.0),
)
WAYPOINTS = (
    Parameter('use_waypoints', True, 'Whether to ask for waypoints'),
    Parameter(
        'llm_client', 'llm_client_node', 'Node to ask for waypoints; empty asks none', fixed=True
    ),
    Parameter('source_timeout', 4.0, 'Seconds to wait for waypoints', minimum=0.0, maximum=3600.0),
    Parameter('instruction', '', 'A wish in plain language, for the language model'),
)
GROUND = (
    Parameter('occupied_threshold', 65, 'Occupancy that blocks', minimum=1, maximum=100),
    Parameter('allow_unknown', True, 'Whether paths may cross unknown cells'),
    Parameter(
        'cost_travel_multiplier',
        2.0,
        'What occupancy that does not block adds to the price of a move; 0: lengths alone',
        minimum=0.0,
        maximum=100.0,
    ),
    Parameter('corner_cutting', False, 'Whether diagonal steps may pass blocked corners'),
    Parameter(
        'robot_radius',
        0.0,
        'Metres kept free around the path; 0 on a costmap, which has it in it',
        minimum=0.0,
        maximum=MAX_RADIUS,
    ),
    Parameter(
        'inflation_radius',
        0.0,
        'Metres from an obstacle up to which cells cost more; 0 on a costmap',
        minimum=0.0,
        maximum=MAX_RADIUS,
    ),
    Parameter(
        'cost_scaling_factor',
        10.0,
        'How fast that cost falls with the distance, a metre',
        minimum=0.0,
        maximum=1000.0,
    ),
)
REQUESTS = (
    Parameter(
        'max_planning_time',
        5.0,
        'Seconds for waypoints, search and path',
        minimum=0.01,
        maximum=3600.0,
    ),
    Parameter(
        'tolerance',
        0.5,
        'Metres the path may end off a goal that cannot be had',
        minimum=0.0,
        maximum=1000.0,
    ),
    Parameter(
        'start_tolerance',
        0.0,
        'Metres the path may begin off a start that is not free',
        minimum=0.0,
        maximum=1000.0,
    ),
    Parameter(
        'use_final_approach_orientation',
        False,
        'Whether the path ends as it arrives, not as the goal looks',
    ),
    Parameter('robot_base_frame', 'base_link', 'The frame of the robot in tf'),
    Parameter('replan_on_map', False, 'Whether each new map replans the last path, broken or not'),
    Parameter(
        'remember_plans',
        64,
        'Plans kept for the same question; 0: nothing is kept, the last path neither',
        minimum=0,
        maximum=100000,
    ),
    Parameter('lifecycle', False, 'Whether the node is a managed one', fixed=True),
    INTROSPECTION_MODE,
)
PARAMETERS = (*SEARCH, *WAYPOINTS, *GROUND, *REQUESTS)


def problem(values: dict[str, Any]) -> str:
    """Say why values cannot be together, or ''."""
    bound = values['max_suboptimality']
    if 0.0 < bound < 1.0:
        return f'max_suboptimality: {bound} is neither 0 (first path) nor 1 or more'
    return instruction_problem(values['instruction'])


def grid_rules(settings: Parameters) -> CostmapConfig:
    """Return the rules of the ground that the parameters state."""
    return planner_options.grid_rules(
        {option.name: settings[option.name] for option in planner_options.RULES}
    )
