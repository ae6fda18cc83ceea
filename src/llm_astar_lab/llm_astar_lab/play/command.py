"""The `llm-astar plan` command that makes the page's plan again."""

from __future__ import annotations

import shlex

from llm_astar_planner.search.result import Cell

from llm_astar_lab.play.request import PlayRequest

EDITED = 'the walls are edited, and a command plans on the map as it is'


def command_of(request: PlayRequest) -> str | None:
    """Return the command line, None where the walls are edited."""
    if request.walls.are_edited:
        return None
    words = ['llm-astar', 'plan', '--map', request.play_map.file]
    if request.play_map.map_id is not None:
        words += ['--map-id', str(request.play_map.map_id)]
    for flag, cell in (('--start', request.start), ('--goal', request.goal)):
        words += [flag, *coordinates(request, cell)]
    for cell in request.via:
        words += ['--via', *coordinates(request, cell)]
    for name, value in request.given.items():
        words.append(flag_of(name.replace('_', '-'), value))
    if request.play_map.is_metric:
        words.append('--cells')
    if request.reply is not None:
        words.append(f'--reply={request.reply}')
    else:
        words += ['--source', request.source]
    return shlex.join(words)


def coordinates(request: PlayRequest, cell: Cell) -> list[str]:
    """Return a cell in the coordinates of the map."""
    x_min, y_min = request.play_map.offset
    return [str(cell[0] + x_min), str(cell[1] + y_min)]


def flag_of(name: str, value: object) -> str:
    """Return the flag of a parameter with its value, which may begin with a dash."""
    if isinstance(value, bool):
        return f'--{name}' if value else f'--no-{name}'
    return f'--{name}={value}'
