"""A map for sentences: wards, bathrooms, doors, objects; and what is understood about it."""

import shapely
from llm_astar_msgs_adapter.maps.places import Place, Places
from llm_astar_planner.instructions.grammar.interpreter import GrammarInterpreter

box = shapely.box
HOSPITAL = Places(
    [
        Place('reception', box(0, 0, 8, 6), aliases=('front desk',)),
        Place('pharmacy', box(8, 0, 16, 6), 'room'),
        Place('ward 1', box(0, 10, 8, 16), 'ward', tags=('blue',)),
        Place('ward 2', box(8, 10, 16, 16), 'ward', tags=('blue',)),
        Place('ward 3', box(16, 10, 24, 16), 'ward', tags=('green',)),
        Place('hallway', box(0, 6, 24, 10)),
        Place('scanner', box(18, 12, 20, 14), 'object'),
        Place('trolley', box(20, 2, 21, 3), 'object'),
        Place('bathroom A', box(0, 20, 4, 24), 'bathroom'),
        Place('bathroom B', box(20, 20, 24, 24), 'bathroom'),
        Place('main door', box(0, 7, 0.5, 9), 'door'),
        Place('fire door', box(23.5, 7, 24, 9), 'door', tags=('emergency',)),
        Place('long wall', box(4, 28, 20, 28.5), 'object'),
        Place('short wall', box(12, 30, 12.5, 36), 'object'),
    ]
)


def read(text, places=HOSPITAL):
    return GrammarInterpreter().interpret(text, places, 1.0)
