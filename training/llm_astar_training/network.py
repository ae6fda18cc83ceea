"""The network in torch; `llm_astar_planner.waypoints.learned` is the same in numpy.

A transformer over the nodes. Its attention and its next-hop logits add a learned term for every
pair of nodes: bilinear forms of how the two nodes lie relative to each barrier, through a small
perceptron, summed over the barriers. Its input is where nodes and barriers are; lines of sight
are not part of it.
"""

from __future__ import annotations

from dataclasses import dataclass

import torch
from llm_astar_planner.waypoints.learned import (
    BARRIER_FEATURES,
    NODE_FEATURES,
    PAIR_FEATURES,
)
from torch import Tensor, nn
from torch.nn import functional as fn


@dataclass(frozen=True)
class Shape:
    """The sizes of the network's layers."""

    width: int = 128
    layers: int = 5
    heads: int = 8
    inner: int = 256
    forms: int = 8
    rank: int = 4
    view: int = 32
    edge: int = 24
    meet: int = 16
    pair: int = 32


class Edges(nn.Module):
    """Features of every pair of nodes, computed from the barriers: [n, edge, N, N]."""

    def __init__(self, shape: Shape) -> None:
        """Make the layers."""
        super().__init__()
        self.shape = shape
        self.view = nn.Linear(BARRIER_FEATURES, shape.view)
        seen = shape.view + BARRIER_FEATURES
        self.left = nn.Linear(seen, shape.forms * shape.rank)
        self.right = nn.Linear(seen, shape.forms * shape.rank)
        self.meet = nn.Linear(shape.forms, shape.meet)
        self.mix = nn.Linear(shape.meet + PAIR_FEATURES, shape.edge)
        self.out = nn.Linear(shape.edge, shape.edge)

    def forward(self, barriers: Tensor, pairs: Tensor) -> Tensor:
        """Take the nodes relative to each barrier [n, N, B, F] and the pairs [n, P, N, N]."""
        n, nodes, each, _ = barriers.shape
        forms, rank = self.shape.forms, self.shape.rank
        seen = torch.cat([fn.relu(self.view(barriers)), barriers], -1)
        left = self.left(seen).view(n, nodes, each, forms, rank).permute(0, 2, 3, 1, 4)
        right = self.right(seen).view(n, nodes, each, forms, rank).permute(0, 2, 3, 4, 1)
        met = ((left @ right) * pairs[:, None, -1:]).flatten(3)
        met = fn.relu(self.meet.weight @ met + self.meet.bias[:, None]).sum(1)
        edge = torch.cat([met, pairs.flatten(2)], 1)
        edge = fn.relu(self.mix.weight @ edge + self.mix.bias[:, None])
        edge = self.out.weight @ edge + self.out.bias[:, None]
        return edge.view(n, self.shape.edge, nodes, nodes)


class Layer(nn.Module):
    """Attention with terms from the edges, then a perceptron."""

    def __init__(self, shape: Shape) -> None:
        """Make the layers."""
        super().__init__()
        self.heads = shape.heads
        self.first = nn.LayerNorm(shape.width)
        self.qkv = nn.Linear(shape.width, 3 * shape.width)
        self.bias = nn.Linear(shape.edge, shape.heads)
        self.out = nn.Linear(shape.width + shape.heads * shape.edge, shape.width)
        self.second = nn.LayerNorm(shape.width)
        self.up = nn.Linear(shape.width, shape.inner)
        self.down = nn.Linear(shape.inner, shape.width)

    def forward(self, x: Tensor, edge: Tensor) -> Tensor:
        """Take nodes [n, N, width] and edges [n, edge, N, N]."""
        n, nodes, width = x.shape
        qkv = self.qkv(self.first(x)).view(n, nodes, 3, self.heads, -1)
        q, k, v = qkv.permute(2, 0, 3, 1, 4)
        bias = self.bias.weight @ edge.flatten(2) + self.bias.bias[:, None]
        logits = q @ k.transpose(-1, -2) * (q.shape[-1] ** -0.5)
        weights = torch.softmax(logits + bias.view(n, self.heads, nodes, nodes), -1)
        heard = (weights @ v).transpose(1, 2).reshape(n, nodes, width)
        # [n, N, heads, N] x [n, N, N, edge]: the edges themselves, weighted by the attention.
        along = weights.permute(0, 2, 1, 3) @ edge.permute(0, 2, 3, 1)
        x = x + self.out(torch.cat([heard, along.flatten(2)], -1))
        return x + self.down(fn.relu(self.up(self.second(x))))


class Network(nn.Module):
    """Logits [n, N, N]: how likely node j is the next hop from node i on a route to the goal."""

    def __init__(self, shape: Shape | None = None) -> None:
        """Make the layers."""
        super().__init__()
        self.shape = shape = shape or Shape()
        self.edges = Edges(shape)
        self.enter = nn.Linear(NODE_FEATURES, shape.width)
        self.enter_out = nn.Linear(shape.width, shape.width)
        self.layers = nn.ModuleList(Layer(shape) for _ in range(shape.layers))
        self.norm = nn.LayerNorm(shape.width)
        self.query = nn.Linear(shape.width, shape.width)
        self.key = nn.Linear(shape.width, shape.width)
        self.left = nn.Linear(shape.width, shape.pair)
        self.right = nn.Linear(shape.width, shape.pair)
        self.across = nn.Linear(shape.edge, shape.pair)
        self.hop = nn.Linear(shape.pair, 1)

    def forward(self, nodes: Tensor, barriers: Tensor, pairs: Tensor) -> Tensor:
        """Take the arrays of `Features`."""
        edge = self.edges(barriers, pairs)
        x = self.enter_out(fn.relu(self.enter(nodes)))
        for layer in self.layers:
            x = layer(x, edge)
        x = self.norm(x)
        logits = self.query(x) @ self.key(x).transpose(1, 2) * (self.shape.width**-0.5)
        pair = self.left(x)[:, :, None] + self.right(x)[:, None]
        pair = fn.relu(pair + self.across(edge.permute(0, 2, 3, 1)))
        return logits + self.hop(pair)[..., 0]
