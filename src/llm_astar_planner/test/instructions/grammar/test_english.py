import pytest
import shapely
from llm_astar_msgs_adapter.maps.places import Place, Places
from llm_astar_planner.instructions.grammar.interpreter import GrammarInterpreter
from llm_astar_planner.instructions.interpretation import Understanding


def box(x0, y0, x1, y1):
    return shapely.box(x0, y0, x1, y1)


HOSPITAL = Places(
    [
        Place('reception', box(0, 0, 8, 6), aliases=('front desk',)),
        Place('pharmacy', box(8, 0, 16, 6)),
        Place('ward 1', box(0, 10, 8, 16), kind='ward', tags=('blue',)),
        Place('ward 2', box(8, 10, 16, 16), kind='ward', tags=('blue',)),
        Place('hallway', box(0, 6, 24, 10)),
        Place('scanner', box(18, 12, 20, 14), kind='object'),
        Place('trolley', box(20, 2, 21, 3), kind='object'),
    ]
)


def understood(text, places=HOSPITAL):
    interpretation = GrammarInterpreter().interpret(text, places, 1.0)
    return interpretation.status, interpretation.sentence


WHOLE = {
    'Please avoid the pharmacy.': 'avoid the pharmacy',
    'do not drive through the pharmacy or the reception': 'avoid the pharmacy; '
    'avoid the reception',
    'visit the pharmacy and the reception': 'visit the pharmacy and the reception in any order',
    'first the pharmacy, then the reception': 'visit the pharmacy, then the reception',
    'keep at least two metres away from the scanner': 'keep 2 m away from the scanner',
    'pass the scanner on the north side': 'pass the scanner on the north side',
}


@pytest.mark.parametrize('text', WHOLE)
def test_is_read_wholly(text):
    assert understood(text) == (Understanding.WHOLE, WHOLE[text])
