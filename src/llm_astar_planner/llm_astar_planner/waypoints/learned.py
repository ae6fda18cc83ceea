# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""The embedded waypoint model: waypoints from a learned network, offline; it is not an LLM.

The network is a small transformer over a map's barrier ends: its inputs, its forward pass in
numpy, float32, and its weights. The arithmetic is that of `training/llm_astar_training/network.py`
in torch; a test compares the two. It gets what a prompt tells an LLM: the map's size, its
barriers, start and goal, but no lines of sight. docs/embedded-model.md describes its training data
and its limits.

A problem with B barriers has N = 2 + 2 B nodes: the start, the goal, and for each barrier the
cell just beyond its first and just beyond its last cell. Arrays are batched over n problems with
the same number of barriers. Training and inference use the same features.
"""

from __future__ import annotations

import hashlib
import io
import json
import threading
import zipfile
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import lru_cache
from importlib.resources import files
from typing import Any

import numpy as np
from llm_astar_msgs_adapter.errors import LlmAstarError, raising
from llm_astar_msgs_adapter.maps.barrier_decomposition import decompose_barriers

from llm_astar_planner.caches import cached
from llm_astar_planner.costmap.costmap import Costmap
from llm_astar_planner.search.any_angle import LineOfSightChecker
from llm_astar_planner.search.arrays import Bools, Float32s, Int32s
from llm_astar_planner.waypoints.config import SourceContext
from llm_astar_planner.waypoints.source import SourceStatus, WaypointQuery, WaypointReply

START, GOAL = 0, 1
# Fourier features of a coordinate: half periods of 1, 1/2, 1/4, ... of the longer side.
WAVES = 6
NODE_FEATURES = 6 * (1 + 2 * WAVES) + 4 + 3 + 3 + 2 + 4
BARRIER_FEATURES = 8
PAIR_FEATURES = 6
# Coordinates relative to a barrier are in units of the longer side divided by this.
PARTS = 6.0


@dataclass(frozen=True)
class Features:
    """The network's inputs, float32."""

    nodes: Float32s  # [n, N, NODE_FEATURES]
    barriers: Float32s  # [n, N, B, BARRIER_FEATURES]: nodes relative to barriers
    pairs: Float32s  # [n, PAIR_FEATURES, N, N]


def place_nodes(barriers: Int32s, endpoints: Int32s) -> Int32s:
    """Return the cells [n, N, 2] of the nodes.

    `barriers` [n, B, 4] are (horizontal, line, first, last), `endpoints` [n, 2, 2] start and goal.
    """
    horizontal, line, first, last = np.moveaxis(barriers, -1, 0)
    tips = np.stack([first - 1, last + 1], axis=-1)
    lines = np.stack([line, line], axis=-1)
    flat = horizontal[..., None] == 1
    cells = np.stack([np.where(flat, tips, lines), np.where(flat, lines, tips)], axis=-1)
    return np.concatenate([endpoints, cells.reshape(len(cells), -1, 2)], axis=1)


def featurise(barriers: Int32s, size: Int32s, endpoints: Int32s) -> Features:
    """Compute the network's inputs; `size` [n, 2] is width and height in cells."""
    cells = place_nodes(barriers, endpoints).astype(np.float32)
    side = size.max(axis=1).astype(np.float32)
    nodes = node_features(barriers, size, cells, side)
    return Features(nodes, barrier_features(barriers, cells, side), pair_features(cells, side))


def node_features(barriers: Int32s, size: Int32s, cells: Float32s, side: Float32s) -> Float32s:
    """Return [n, N, NODE_FEATURES]; `cells` [n, N, 2] are the nodes, `side` [n] longer sides."""
    count, nodes = cells.shape[:2]
    unit = side[:, None, None]
    places = np.concatenate(
        [cells - size[:, None] / 2, cells - cells[:, :1], cells - cells[:, 1:2]], axis=-1
    )
    places = (places / unit).astype(np.float32)
    turns = np.pi * 2.0 ** np.arange(WAVES, dtype=np.float32)
    waves = (places[..., None] * turns).astype(np.float32).reshape(count, nodes, -1)
    walls = np.concatenate([cells, size[:, None] - 1 - cells], axis=-1)
    shape = np.stack([np.log(side / 50), *(size / side[:, None]).T], axis=-1)
    kinds = np.zeros((count, nodes, 3), np.float32)
    kinds[:, START, 0] = kinds[:, GOAL, 1] = kinds[:, 2:, 2] = 1
    parts = [
        places, np.sin(waves), np.cos(waves), np.tanh(walls / 4),
        np.broadcast_to(shape[:, None], (count, nodes, 3)),
        kinds, tip_features(barriers, unit),
    ]  # fmt: skip
    return np.concatenate(parts, axis=-1, dtype=np.float32)


def tip_features(barriers: Int32s, unit: Float32s) -> Float32s:
    """Return [n, N, 6]: the direction in which a barrier's end points; zeros for start and goal.

    The unit vector, the vector times the barrier's length over the longer side, and the vector
    times tanh(length in cells / 8).
    """
    count, each = barriers.shape[:2]
    flat = barriers[..., None, 0]
    away = np.array([-1, 1], np.float32)
    points = np.stack([flat * away, (1 - flat) * away], axis=-1).reshape((count, 2 * each, 2))
    cells = np.repeat(barriers[..., 3] - barriers[..., 2] + 1, 2, axis=1)[..., None]
    tips = np.concatenate([points, points * cells / unit, points * np.tanh(cells / 8)], axis=-1)
    return np.concatenate([np.zeros((count, 2, 6)), tips], axis=1, dtype=np.float32)


def barrier_features(barriers: Int32s, cells: Float32s, side: Float32s) -> Float32s:
    """Return [n, N, B, BARRIER_FEATURES]: nodes relative to a barrier's ends and its line."""
    horizontal, line, first, last = np.moveaxis(barriers[:, None], -1, 0)
    x, y = cells[:, :, None, 0], cells[:, :, None, 1]
    along = np.where(horizontal == 1, x, y)
    across = np.where(horizontal == 1, y, x)
    from_ends = np.stack([along - first, along - last, across - line], axis=-1)
    own = np.zeros(along.shape, np.float32)
    for k in range(barriers.shape[1]):
        own[:, 2 + 2 * k : 4 + 2 * k, k] = 1
    parts = [
        from_ends * (PARTS / side[:, None, None, None]), np.tanh(from_ends / 2),
        own[..., None], np.ones_like(own)[..., None],
    ]  # fmt: skip
    return np.concatenate(parts, axis=-1, dtype=np.float32)


def pair_features(cells: Float32s, side: Float32s) -> Float32s:
    """Return [n, PAIR_FEATURES, N, N]: offset from node i to j, distance, inverse distance."""
    gap = cells[:, None] - cells[:, :, None]
    apart = np.hypot(gap[..., 0], gap[..., 1])
    unit = side[:, None, None]
    parts = [
        gap[..., 0] / unit, gap[..., 1] / unit, apart / unit,
        np.tanh(apart / 3), np.sqrt(apart / unit), PARTS / (PARTS * apart / unit + 0.3),
    ]  # fmt: skip
    return np.stack(parts, axis=1).astype(np.float32)


try:
    from threadpoolctl import ThreadpoolController
except ImportError:  # pip installs it, but rosdep has no key for it
    ThreadpoolController = None

WEIGHTS_FILE = 'weights.npz'
FORMAT = 1
# Of the arrays; the shipped ones have a tenth.
MAX_BYTES = 64_000_000
_EPSILON = np.float32(1e-5)
# The limit on BLAS threads is per process, so only one pass at a time may set and restore it.
_ONE_PASS = threading.Lock()


class WeightsError(LlmAstarError, ValueError):
    """A weights file cannot be used; the message names the file and what is wrong."""


@dataclass(frozen=True, eq=False)
class Weights:
    """The weights by their names in torch, the sizes of the network and the file's digest."""

    arrays: Mapping[str, Float32s]
    shape: Mapping[str, int]
    digest: str

    def linear(self, name: str, x: Float32s) -> Float32s:
        """Apply a linear layer to the last axis."""
        result: Float32s = x @ self.arrays[f'{name}.weight'].T
        result += self.arrays[f'{name}.bias']
        return result

    def channels(self, name: str, x: Float32s) -> Float32s:
        """Apply a linear layer to the last axis but one."""
        result: Float32s = self.arrays[f'{name}.weight'] @ x
        result += self.arrays[f'{name}.bias'][:, None]
        return result

    def norm(self, name: str, x: Float32s) -> Float32s:
        """Apply a layer norm to the last axis."""
        x = x - x.mean(axis=-1, keepdims=True)
        scale = np.sqrt(np.square(x).mean(axis=-1, keepdims=True) + _EPSILON)
        return np.asarray(x / scale * self.arrays[f'{name}.weight'] + self.arrays[f'{name}.bias'])


@lru_cache(maxsize=1)
def packaged_weights() -> Weights:
    """Return the weights shipped with the package, read once."""
    data = (files('llm_astar_planner.waypoints') / WEIGHTS_FILE).read_bytes()
    return read_weights(data, WEIGHTS_FILE)


def read_weights(data: bytes, name: str = 'weights') -> Weights:
    """Read a file that the training has written. Raises WeightsError."""
    # Whatever a damaged archive leads to.
    with raising(WeightsError, f'{name}: is no file of exported weights: ', Exception):
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            if sum(item.file_size for item in archive.infolist()) > MAX_BYTES:
                raise ValueError(f'it would fill over {MAX_BYTES} bytes')
        with np.load(io.BytesIO(data), allow_pickle=False) as held:
            header = json.loads(held['header'].tobytes())
            arrays = {key: held[key].astype(np.float32) for key in held if key != 'header'}
    if header.pop('format', None) != FORMAT:
        raise WeightsError(f'{name}: format: is not {FORMAT}; export the weights again')
    return Weights(arrays, header, hashlib.sha256(data).hexdigest()[:12])


def hop_logits(weights: Weights, features: Features) -> Float32s:
    """Return logits [n, N, N] that the next hop from node i is node j.

    Runs on one core: on a busy machine, BLAS threads make matrices this small ten times slower.
    """
    if ThreadpoolController is None:
        return forward(weights, features)
    with _ONE_PASS, blas_controller().limit(limits=1, user_api='blas'):
        return forward(weights, features)


@lru_cache(maxsize=1)
def blas_controller() -> Any:  # noqa: ANN401 - a class that may be missing
    """Return the controller of the BLAS threads, made once."""
    return ThreadpoolController()


def forward(weights: Weights, features: Features) -> Float32s:
    """Return the logits [n, N, N] of the next hops."""
    edge = edge_features(weights, features)
    x = weights.linear('enter_out', relu(weights.linear('enter', features.nodes)))
    for layer in range(weights.shape['layers']):
        x = apply_layer(weights, f'layers.{layer}', x, edge)
    x = weights.norm('norm', x)
    query, key = weights.linear('query', x), weights.linear('key', x)
    logits = query @ key.swapaxes(1, 2) * np.float32(x.shape[-1] ** -0.5)
    pair = weights.linear('left', x)[:, :, None] + weights.linear('right', x)[:, None]
    pair = pair + weights.linear('across', edge.transpose(0, 2, 3, 1))
    return np.asarray(logits + weights.linear('hop', relu(pair))[..., 0])


def edge_features(weights: Weights, features: Features) -> Float32s:
    """Return features of every pair of nodes [n, edge, N, N], summed over the barriers."""
    pairs = features.pairs
    n, nodes, each, _ = features.barriers.shape
    forms, rank = weights.shape['forms'], weights.shape['rank']
    seen = relu(weights.linear('edges.view', features.barriers))
    views = np.concatenate([seen, features.barriers], axis=-1)
    left, right = (
        weights.linear(f'edges.{side}', views).reshape(n, nodes, each, forms, rank)
        for side in ('left', 'right')
    )
    left, right = left.transpose(0, 2, 3, 1, 4), right.transpose(0, 2, 3, 4, 1)
    near = pairs[:, None, -1]
    total = np.zeros((n, weights.shape['meet'], nodes * nodes), np.float32)
    products, formed = np.empty((n, forms, nodes, nodes), np.float32), np.empty_like(total)
    zeros = np.zeros(total.shape[1:], np.float32)
    bias = zeros + weights.arrays['edges.meet.bias'][:, None]
    # One barrier at a time and in place: the forms of all 30 would not fit into the CPU cache.
    for k in range(each):
        np.matmul(left[:, k], right[:, k], out=products)
        np.multiply(products, near, out=products)
        np.matmul(weights.arrays['edges.meet.weight'], products.reshape(n, forms, -1), out=formed)
        total += np.maximum(np.add(formed, bias, out=formed), zeros, out=formed)
    edge = np.concatenate([total, pairs.reshape(n, -1, nodes * nodes)], axis=1)
    edge = weights.channels('edges.out', relu(weights.channels('edges.mix', edge)))
    return edge.reshape(n, -1, nodes, nodes)


def apply_layer(weights: Weights, name: str, x: Float32s, edge: Float32s) -> Float32s:
    """Apply one layer: attention over the nodes, biased by the edge features, and the MLP."""
    n, nodes, width = x.shape
    heads = weights.shape['heads']
    qkv = weights.linear(f'{name}.qkv', weights.norm(f'{name}.first', x))
    q, k, v = qkv.reshape(n, nodes, 3, heads, -1).transpose(2, 0, 3, 1, 4)
    bias = weights.channels(f'{name}.bias', edge.reshape(n, -1, nodes * nodes))
    scores = q @ k.swapaxes(-1, -2) * np.float32(q.shape[-1] ** -0.5)
    attention = softmax(scores + bias.reshape(n, heads, nodes, nodes))
    mixed = (attention @ v).swapaxes(1, 2).reshape(n, nodes, width)
    along = attention.swapaxes(1, 2) @ edge.transpose(0, 2, 3, 1)
    both = np.concatenate([mixed, along.reshape(n, nodes, -1)], axis=-1)
    x = x + weights.linear(f'{name}.out', both)
    inner = relu(weights.linear(f'{name}.up', weights.norm(f'{name}.second', x)))
    return x + weights.linear(f'{name}.down', inner)


def relu(x: Float32s) -> Float32s:
    """Return max(x, 0)."""
    # An array of zeros makes this three times as fast as the number 0.
    return np.maximum(x, np.zeros(x.shape[-2:], np.float32))


def softmax(x: Float32s) -> Float32s:
    """Return the softmax over the last axis."""
    x = np.exp(x - x.max(axis=-1, keepdims=True))
    return np.asarray(x / x.sum(axis=-1, keepdims=True))


# A route is a list of node numbers, START first and GOAL last.
Route = tuple[int, ...]
# The most barriers in the training data; a map with more is approximated by this many.
MAX_BARRIERS = 30
MAPS_KEPT = 4
# A route with this many hops goes straight to the goal from there.
MAX_HOPS = 24
# How many routes are drawn for each candidate; draws may repeat a route.
DRAWS_PER_CANDIDATE = 4


def make_embedded(context: SourceContext) -> EmbeddedSource:
    """Make the source with the `candidates` of the settings.

    Reads the weights, so that a broken file is reported now and not at the first query.
    """
    packaged_weights()
    return EmbeddedSource(context.settings.candidates)


@dataclass(frozen=True)
class EmbeddedSource:
    """Answers with the network's route: the cells next to barrier ends where it turns.

    With one candidate the answer is the greedy route, whose lines of sight are not checked. With
    more, the others are drawn by their probabilities, and the answer is the shortest route whose
    segments are all lines of sight, or none: a blocked route misleads more than no waypoints.
    Equal queries get equal answers. Thread-safe; needs no network connection.
    """

    candidates: int = 1
    name: str = 'embedded'

    @property
    def label(self) -> str:
        """Name of the model for reports, with the digest of its weights."""
        return f'embedded:learned waypoint model {packaged_weights().digest}, not an LLM'

    def waypoints(self, query: WaypointQuery) -> WaypointReply:
        """Return free cells to turn at; none where the path is straight or no route is found."""
        cells, routes = self._routes(query)
        route: Route | None = routes[0]
        if self.candidates > 1:
            route = shortest_in_sight(routes, cells, query.costmap.line_of_sight)
        turns = () if route is None else route[1:-1]
        points = tuple((float(x), float(y)) for x, y in cells[list(turns)])
        status = SourceStatus.OK if points else SourceStatus.NO_WAYPOINTS
        detail = '' if route else f'none of {len(routes)} routes drawn is in sight'
        model = packaged_weights().digest
        return WaypointReply(points, self.label, status, detail, model=model)

    def _routes(self, query: WaypointQuery) -> tuple[Int32s, list[Route]]:
        """Return the cells [N, 2] of the nodes, and routes over them, the greedy one first."""
        height, width = query.costmap.blocked.shape
        barriers = barriers_of(query.costmap)[None]
        size = np.array([[width, height]], np.int32)
        endpoints = np.array([[query.start, query.goal]], np.int32)
        cells = place_nodes(barriers, endpoints)[0]
        features = featurise(barriers, size, endpoints)
        logits = hop_logits(packaged_weights(), features)[0]
        usable = usable_nodes(cells, query.costmap.blocked)
        return cells, draw_routes(logits, usable, self.candidates, query.random_generator())


@cached(MAPS_KEPT, key=lambda costmap: costmap.key)
def barriers_of(costmap: Costmap) -> Int32s:
    """Return a costmap's barriers [B, 4] as (horizontal, line, first, last), computed once."""
    found = decompose_barriers(costmap.blocked, MAX_BARRIERS)
    rows = [(1, *barrier) for barrier in found.horizontal_barriers]
    rows += [(0, *barrier) for barrier in found.vertical_barriers]
    return np.array(rows, np.int32).reshape(-1, 4)


def usable_nodes(cells: Int32s, blocked: Bools) -> Bools:
    """Return which nodes [N] a route may visit: free cells [N, 2] on the map, no cell twice.

    `blocked` is bool [height, width]. The goal is always usable.
    """
    height, width = blocked.shape
    x, y = cells.T
    inside = (x >= 0) & (x < width) & (y >= 0) & (y < height)
    on_map = np.where(inside[:, None], cells, 0)
    first = np.zeros(len(cells), dtype=np.bool_)
    # A node is at most one cell off the map, so different cells get different numbers.
    first[np.unique(y * (width + 2) + x, return_index=True)[1]] = True
    usable: Bools = inside & ~blocked[on_map[:, 1], on_map[:, 0]] & first
    usable[GOAL] = True
    return usable


def draw_routes(
    logits: Float32s, usable: Bools, count: int, random: np.random.Generator
) -> list[Route]:
    """Return up to `count` different routes from start to goal, the greedy one first.

    The others follow hops drawn by their probabilities. `logits` is [N, N], `usable` [N].
    """
    routes = [follow(logits, usable)]
    for _ in range(DRAWS_PER_CANDIDATE * (count - 1)):
        if len(routes) == count:
            break
        route = follow(logits, usable, random)
        if route not in routes:
            routes.append(route)
    return routes


def follow(logits: Float32s, usable: Bools, random: np.random.Generator | None = None) -> Route:
    """Return a route of the most probable hops, or of hops drawn with `random`.

    No node is visited twice. `logits` is [N, N], `usable` [N].
    """
    left = usable.copy()
    route = [START]
    while route[-1] != GOAL:
        left[route[-1]] = False
        row = np.where(left, logits[route[-1]], -np.inf)
        if len(route) > MAX_HOPS:
            route.append(GOAL)
        elif random is None:
            route.append(int(row.argmax()))
        else:
            # The argmax after adding Gumbel noise is a draw from the softmax.
            route.append(int((row + random.gumbel(size=len(row))).argmax()))
    return tuple(route)


def shortest_in_sight(
    routes: Iterable[Route], cells: Int32s, sight: LineOfSightChecker
) -> Route | None:
    """Return the shortest route whose segments are all lines of sight, None if there is none."""

    def length(route: Route) -> float:
        return float(np.hypot(*np.diff(cells[list(route)], axis=0).T).sum())

    shortest_first = sorted(routes, key=length)
    return next((r for r in shortest_first if sight.clear_along(cells[list(r)])), None)
