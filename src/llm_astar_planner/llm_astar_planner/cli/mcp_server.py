# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""The MCP server of `llm-astar mcp`: the route tools with their schemas. Needs the extra `mcp`."""

from __future__ import annotations

from collections.abc import Callable
from functools import wraps
from typing import Annotated, Any, ParamSpec

from llm_astar_msgs_adapter.errors import LlmAstarError
from mcp.server.mcpserver import MCPServer
from mcp.server.mcpserver.exceptions import ToolError
from mcp.types import ToolAnnotations
from pydantic import Field

from llm_astar_planner import __version__
from llm_astar_planner.cli.route_tools import MAX_POINTS, RouteTools
from llm_astar_planner.instructions.text import MAX_INSTRUCTION_CHARS, POLICIES

ABOUT = """\
Plans routes for a robot on one map and holds paths against instructions in plain language.
Points are [x, y] in metres of the map's frame, x east and y north. Call list_places first.
A path keeps to an instruction only as far as `instruction.sentence` and `instruction.clauses` of
the answer say: "kept" was measured on the path. If it has `questions`, put them to a person, and
plan again with `confirm` only if the answer is yes.
"""
READ_ONLY = ToolAnnotations(read_only_hint=True, idempotent_hint=True, open_world_hint=False)
P = ParamSpec('P')

Point = Annotated[list[float], Field(min_length=2, max_length=2, description='[x, y] in metres')]
PlaceOrPoint = Annotated[str | Point, Field(description='name of a place, or [x, y] in metres')]
Instruction = Annotated[
    str,
    Field(
        max_length=MAX_INSTRUCTION_CHARS,
        description='what is asked of the way, such as "avoid the kitchen; visit the dock, then '
        'the lab"; empty for none',
    ),
]


def make_server(tools: Callable[[], RouteTools]) -> MCPServer[Any]:
    """Return the server; each of its tools asks those that `tools` returns at that moment."""
    server: MCPServer[Any] = MCPServer(
        'llm-astar', version=__version__, instructions=ABOUT, log_level='WARNING'
    )

    @server.tool(annotations=READ_ONLY)
    @as_tool_errors
    def list_places() -> dict[str, Any]:
        """List the named places of the map: name, kind, tags, aliases, centre, area in m2."""
        return tools().list_places()

    @server.tool(annotations=READ_ONLY)
    @as_tool_errors
    def interpret(text: Instruction) -> dict[str, Any]:
        """Say what is understood of an instruction, without planning.

        `sentence` says it in plain words, `specification` clause by clause; what was not
        understood is a clause of kind "unknown".
        """
        return tools().interpret(text)

    # It remembers what is confirmed.
    @server.tool(annotations=READ_ONLY.model_copy(update={'read_only_hint': False}))
    @as_tool_errors
    def plan_route(
        start: PlaceOrPoint,
        goal: PlaceOrPoint,
        instruction: Instruction = '',
        policy: Annotated[str, Field(description=f'one of {", ".join(POLICIES)}')] = '',
        confirm: Annotated[
            bool, Field(description='a person has said yes to the questions')
        ] = False,
    ) -> dict[str, Any]:
        """Plan a path that keeps to an instruction as far as possible.

        The answer has the path's points, its length in metres, and for each clause whether the
        path keeps it. With the policy `require` there is no path unless it keeps all clauses, or
        while there are `questions`: unsure readings that a person has to confirm.
        """
        return tools().plan_route(start, goal, instruction, policy, confirm)

    @server.tool(annotations=READ_ONLY)
    @as_tool_errors
    def ask_why(
        start: PlaceOrPoint,
        goal: PlaceOrPoint,
        question: Annotated[str, Field(max_length=MAX_INSTRUCTION_CHARS)],
    ) -> dict[str, Any]:
        """Answer "why not through PLACE?", "why so long?" or "what if PLACE were open?"."""
        return tools().ask_why(start, goal, question)

    @server.tool(annotations=READ_ONLY)
    @as_tool_errors
    def check_path(
        points: Annotated[list[Point], Field(min_length=1, max_length=MAX_POINTS)],
        instruction: Instruction = '',
    ) -> dict[str, Any]:
        """Say whether a path of straight segments can be driven and keeps to an instruction."""
        return tools().check_path(points, instruction)

    return server


def as_tool_errors(tool: Callable[P, dict[str, Any]]) -> Callable[P, dict[str, Any]]:
    """Return a tool whose own errors reach the client as errors of the tool."""

    @wraps(tool)
    def wrapped(*args: P.args, **kwargs: P.kwargs) -> dict[str, Any]:
        try:
            return tool(*args, **kwargs)
        except LlmAstarError as error:
            raise ToolError(str(error)) from error

    return wrapped
