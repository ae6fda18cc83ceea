"""Places that tests of instructions share: a small hospital floor."""

from llm_astar_msgs_adapter.maps.places import places_from_polygons


def box(x0, y0, x1, y1):
    return [[x0, y0], [x1, y0], [x1, y1], [x0, y1]]


HOSPITAL = places_from_polygons(
    {
        'lobby': {'polygon': box(0, 0, 10, 8), 'kind': 'room', 'aliases': ['entrance']},
        'ward 1': {'polygon': box(10, 0, 20, 8), 'kind': 'room', 'tags': ['blue']},
        'ward 2': {'polygon': box(20, 0, 30, 8), 'kind': 'room', 'tags': ['blue']},
        'kitchen': {'polygon': box(0, 12, 10, 20), 'kind': 'room', 'aliases': ['canteen']},
        'store room': {'polygon': box(20, 12, 30, 20), 'kind': 'room'},
        'main corridor': {
            'polygon': box(0, 8, 30, 12),
            'kind': 'corridor',
            'aliases': ['hallway'],
        },
        'lift': {'polygon': box(14, 9, 16, 11), 'kind': 'object', 'aliases': ['elevator']},
        'wall x=12': {'polygon': box(11.5, 12, 12.5, 20), 'kind': 'object'},
    }
)
