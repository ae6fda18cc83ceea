"""Plan a path that keeps an instruction in plain language, and check each clause."""

from llm_astar_msgs_adapter.maps.places import load_places
from llm_astar_planner.instructions.grammar.interpreter import GrammarInterpreter
from llm_astar_planner.instructions.interpretation import RouteInstruction
from llm_astar_planner.resources import find_file

from llm_astar_planner import CostmapConfig, Planner, PlanRequest

places = load_places(find_file('instructions/warehouse.places.geojson', 'maps'))
warehouse = find_file('instructions/warehouse.yaml', 'maps')
planner = Planner(warehouse, CostmapConfig(robot_radius=0.3)).prepare()

text = 'visit the charging bay and stay out of the north lane'
reading = GrammarInterpreter().interpret(text, places, 1.0)
instruction = RouteInstruction(reading, places)
plan = planner.plan(PlanRequest((20, 20), (180, 100), instruction=instruction, time_limit=30.0))

print(plan.code.name, plan.instruction.sentence())
print(plan.instruction.summary())
