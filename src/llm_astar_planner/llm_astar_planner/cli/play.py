"""Plan in the browser: drag start and goal, draw walls, and watch the search."""

from __future__ import annotations

import argparse
import threading
import webbrowser

EPILOG = """\
examples:
  llm-astar play
  llm-astar play --map depot.yaml --map maze.map.scen
  llm-astar play --port 9000 --no-browser
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options."""
    parser.add_argument(
        '--map',
        action='append',
        default=[],
        metavar='FILE',
        help='a map to offer besides the shipped ones: map_server yaml, MovingAI x.map.scen or '
        'barrier-map JSON; repeat it for more',
    )
    parser.add_argument(
        '--host', default='127.0.0.1', help='address to serve at (default: %(default)s)'
    )
    parser.add_argument(
        '--port', type=int, default=8321, help='port to serve at (default: %(default)s)'
    )
    parser.add_argument('--no-browser', action='store_true', help='do not open the browser')


def run(arguments: argparse.Namespace) -> int:
    """Serve until Ctrl-C; return 0. Raises what reading maps raises."""
    # Optional dependencies; the help needs to work without them.
    import uvicorn  # noqa: PLC0415

    from llm_astar_planner.play.app import PlayApp  # noqa: PLC0415
    from llm_astar_planner.play.maps import Maps  # noqa: PLC0415

    app = PlayApp(Maps(arguments.map), {arguments.host})
    url = f'http://{arguments.host}:{arguments.port}/'
    print(f'open {url}  (Ctrl-C ends it)', flush=True)
    if not arguments.no_browser:
        threading.Timer(1.0, webbrowser.open, [url]).start()
    uvicorn.run(app.asgi(), host=arguments.host, port=arguments.port, log_level='warning')
    return 0
