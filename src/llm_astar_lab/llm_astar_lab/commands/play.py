# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""Plan in the browser: say how the robot is to go, drag its goal, draw walls, watch the search.

A small server on this machine shows the page; nothing is sent anywhere else.

examples:
  llm-astar play
  llm-astar play --map depot.yaml --map maze.map.scen
  llm-astar play --port 9000 --no-browser
  llm-astar play --live --namespace /robot1

The page says whether the path keeps the instruction, shows how a search expands the map cell by
cell, and its figures beside those without waypoints and of A*. A map may be dropped onto it, and
places and zones that are drawn are saved as GeoJSON. Its address holds the whole view, so a link
shows it again, and it gives the `llm-astar plan` command that makes the same plan.

Ctrl-C ends the server. Only this machine reaches it; --host 0.0.0.0 opens it to the network, whose
members may then plan on the listed maps, add ten of their own and watch the graph of --live, but
read no other file.

exit codes: 0 ended with Ctrl-C, 1 a library is missing, 2 bad usage, a bad map or a port in use
"""

import argparse
import threading
import webbrowser
from contextlib import ExitStack

from llm_astar_planner.cli.flags import add_graph_options, option

DEFAULT_HOST, DEFAULT_PORT = '127.0.0.1', 8321


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options."""
    kinds = 'map_server yaml, MovingAI x.map or x.map.scen, or barrier-map JSON'
    text = f'{kinds}, of which the first ten are taken; repeat it for more'
    text = f'a map to offer besides the shipped ones: {text}'
    option(parser, '--map FILE', text, action='append', default=[])
    text = 'address to serve at (default: %(default)s)'
    option(parser, '--host NAME', text, default=DEFAULT_HOST)
    text = 'port to serve at; 0 takes a free one (default: %(default)s)'
    option(parser, '--port N', text, default=DEFAULT_PORT)
    option(parser, '--no-browser', 'do not open the browser')
    graph = parser.add_argument_group('a running graph')
    option(graph, '--live', 'show the map, plans and reports of a running planner too')
    add_graph_options(graph, client=True)


def run(arguments: argparse.Namespace) -> int:
    """Serve until Ctrl-C; return 0.

    Raises ParameterError where it cannot serve at the address, NodeNameError for a name that no
    node can have, and what reading maps raises.
    """
    # Not at the top: the help should not wait for them.
    from llm_astar_lab.play.live import LiveFeed  # noqa: PLC0415
    from llm_astar_lab.play.maps import Maps  # noqa: PLC0415
    from llm_astar_lab.play.server import PlayApp, listen, serve, url_of  # noqa: PLC0415

    feed = LiveFeed() if arguments.live else None
    app = PlayApp(Maps(arguments.map), feed)
    with listen(arguments.host, arguments.port) as listener, ExitStack() as shown:
        if feed is not None:
            # ROS is needed for this alone.
            from llm_astar_lab.nodes.live_view import live_view  # noqa: PLC0415

            names = arguments.namespace, arguments.node, arguments.client
            shown.enter_context(live_view(*names, feed))
        url = url_of(arguments.host, listener.getsockname()[1])
        print(f'the page is at {url} (Ctrl-C ends it)', flush=True)
        if not arguments.no_browser:
            threading.Thread(target=webbrowser.open, args=(url,), daemon=True).start()
        serve(app, arguments.host, listener)
    print('stopped')
    return 0
