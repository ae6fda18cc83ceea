"""Random specifications on random maps: a plan with its outcome comes of each, never an error."""

import json
import math

import numpy as np
import pytest
import shapely
from llm_astar_msgs_adapter.maps.grid_map import GridMap, Pose2D
from llm_astar_msgs_adapter.maps.places import Place, Places
from llm_astar_planner.costmap.config import CostmapConfig
from llm_astar_planner.instructions.clauses.avoid import Avoid
from llm_astar_planner.instructions.clauses.before import Before
from llm_astar_planner.instructions.clauses.clause import MUST, STRENGTHS
from llm_astar_planner.instructions.clauses.end_at import EndAt
from llm_astar_planner.instructions.clauses.keep_distance import KeepDistance
from llm_astar_planner.instructions.clauses.pass_by import Pass
from llm_astar_planner.instructions.clauses.stay_in import StayIn
from llm_astar_planner.instructions.clauses.unknown import Unknown
from llm_astar_planner.instructions.clauses.visit import Visit
from llm_astar_planner.instructions.interpretation import (
    Interpretation,
    RouteInstruction,
    status_of,
)
from llm_astar_planner.instructions.regions import (
    COMPASS,
    SIDES,
    Along,
    Between,
    Box,
    Disc,
    Half,
    NamedPlace,
    Tagged,
)
from llm_astar_planner.instructions.specification import Specification
from llm_astar_planner.instructions.text import POLICIES, REQUIRE
from llm_astar_planner.planning.compile import compile_instruction_kernels
from llm_astar_planner.planning.planner import Planner
from llm_astar_planner.planning.types import PlanRequest

NAMES = ('square', 'round', 'odd', 'nowhere')
METHODS = ('guided', 'guided', 'exact_astar', 'llm_astar')


def random_range(random):
    low, high = sorted(random.uniform(-5, 25, 2))
    return (low if random.random() < 0.7 else -math.inf), high + 0.01


def random_region(random):
    name, other = random.choice(NAMES, 2)
    (x0, x1), (y0, y1) = random_range(random), random_range(random)
    return [
        NamedPlace(str(name)),
        Tagged(str(random.choice(['tag', 'other']))),
        Disc(*random.uniform(-5, 25, 2).tolist(), float(random.choice([0.0, 0.1, 5.0, 500.0]))),
        Box(x0, y0, x1, y1),
        Half(str(random.choice(SIDES))),
        Half(str(random.choice(COMPASS)), str(name)),
        Between(str(name), str(other)),
        Along(str(name), float(random.choice([0.01, 1.0, 50.0]))),
        Along('walls', 0.5),
    ][random.integers(9)]


def random_clause(random):
    both = str(random.choice(STRENGTHS)), bool(random.random() < 0.1)
    region, other = random_region(random), random_region(random)
    metres = float(random.choice([0.01, 0.5, 2.0, 900.0]))
    return [
        Avoid(*both, region, float(random.choice([0.0, 1.0]))),
        Visit(*both, (region,)),
        Visit(*both, (region, other)),
        Before(*both, region, other),
        StayIn(*both, region),
        Pass(*both, region, str(random.choice(SIDES))),
        KeepDistance(*both, metres, None),
        KeepDistance(*both, metres, region),
        EndAt(*both, region),
        Unknown(text='hm'),
    ][random.integers(10)]


def random_planner(random):
    shape = random.integers(1, 25, 2)
    cells = np.where(random.random(shape) < random.choice([0.0, 0.1, 0.3]), 100, 0)
    cells[random.random(shape) < 0.05] = -1
    origin = Pose2D(*random.uniform(-2, 2, 2).tolist(), float(random.choice([0.0, 0.7])))
    radius = float(random.choice([0.0, 0.3]))
    config = CostmapConfig(robot_radius=radius, corner_cutting=bool(random.random() < 0.5))
    grid_map = GridMap(cells.astype(np.int8), float(random.choice([0.05, 0.5, 1.0])), origin)
    return Planner(grid_map, config)


def random_places(random):
    odd = [shapely.Point(3, 3), shapely.LineString([(0, 0), (9, 9)]), shapely.box(-9, -9, -8, -8)]
    return Places(
        [
            Place('square', shapely.box(1, 1, 4, 4), 'tag'),
            Place('round', shapely.Point(random.uniform(-2, 20, 2)).buffer(1.5), 'object'),
            Place('odd', odd[random.integers(len(odd))], tags=('tag',)),
        ]
    )


@pytest.fixture(scope='module', autouse=True)
def _compiled():
    compile_instruction_kernels()


def plan_at_random(seed):
    random = np.random.default_rng(seed)
    planner, places = random_planner(random), random_places(random)
    clauses = tuple(random_clause(random) for _ in range(random.integers(0, 4)))
    specification = Specification(clauses)
    interpretation = Interpretation('text', specification, 'truth', status_of(specification))
    policy = str(random.choice(POLICIES))
    size = planner.grid_map.width, planner.grid_map.height
    request = PlanRequest(
        tuple(random.integers(size)),
        tuple(random.integers(size)),
        method=str(random.choice(METHODS)),
        any_angle=bool(random.random() < 0.3),
        instruction=RouteInstruction(interpretation, places, policy),
    )
    return planner, request, planner.plan(request)


def check(seed):
    planner, request, plan = plan_at_random(seed)
    outcome = plan.instruction
    json.dumps(plan.to_dict(), allow_nan=False)
    specification = request.instruction.interpretation.specification
    is_judged = len(plan.path) or outcome.note == 'of a path that was withheld'
    assert len(outcome.clauses) == (len(specification.clauses) if is_judged else 0)
    if plan.code != 0 and request.instruction.policy != REQUIRE:
        direct = planner.plan(PlanRequest(request.start, request.goal, method=request.method))
        assert direct.code == plan.code
    if plan.code == 0 and request.instruction.policy == REQUIRE:
        musts = [one for one in outcome.clauses if one.clause.strength == MUST]
        assert all(one.status.value == 'kept' for one in musts)


@pytest.mark.parametrize('seed', range(60))
def test_a_plan_comes_of_every_specification(seed):
    check(seed)


@pytest.mark.slow
def test_plans_come_of_many_specifications():
    for seed in range(1000, 6000):
        check(seed)
