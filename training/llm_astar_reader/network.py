"""The network in torch, and its file for the inference in numpy."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import torch
from llm_astar_planner.instructions.reader.features import BUCKETS, features
from llm_astar_planner.instructions.reader.meaning import TOKENS
from torch import nn

Sentences = Sequence[Sequence[str]]

WORD, ENCODER, DECODER, TOKEN = 64, 96, 160, 48


class Reader(nn.Module):
    """Encodes a lifted sentence by a bidirectional GRU; writes its meaning by another."""

    def __init__(self) -> None:
        """Begin with random weights."""
        super().__init__()
        self.words = nn.EmbeddingBag(BUCKETS, WORD, mode='sum')
        nn.init.normal_(self.words.weight, std=0.3)
        self.encoder = nn.GRU(
            WORD, ENCODER, num_layers=2, bidirectional=True, batch_first=True, dropout=0.1
        )
        self.start = nn.Linear(2 * ENCODER, DECODER)
        self.tokens = nn.Embedding(len(TOKENS) + 1, TOKEN)  # the last one begins
        self.decoder = nn.GRU(TOKEN, DECODER, batch_first=True)
        self.query = nn.Linear(DECODER, 2 * ENCODER, bias=False)
        self.mix = nn.Linear(DECODER + 2 * ENCODER, DECODER)
        self.out = nn.Linear(DECODER, len(TOKENS))
        self.drop = nn.Dropout(0.15)

    def forward(self, sentences: Sentences, previous: torch.Tensor) -> torch.Tensor:
        """Return logits [n, steps, tokens] for sentences of one length and the tokens before."""
        encoded, _ = self.encoder(self.drop(self.embedded(sentences)))
        encoded = self.drop(encoded)
        first = torch.tanh(self.start(encoded.mean(1)))
        states, _ = self.decoder(self.drop(self.tokens(previous)), first[None].contiguous())
        scores = self.query(states) @ encoded.transpose(1, 2)
        context = torch.softmax(scores, -1) @ encoded
        return self.out(self.drop(torch.tanh(self.mix(torch.cat((states, context), -1)))))

    def embedded(self, sentences: Sentences) -> torch.Tensor:
        """Return the embeddings [n, length, WORD] of sentences of one length."""
        kinds = list({token for sentence in sentences for token in sentence})
        rows = [features(kind) for kind in kinds]
        flat = torch.tensor([row for one in rows for row, _ in one])
        weights = torch.tensor([weight for one in rows for _, weight in one])
        ends = np.cumsum([0, *(len(one) for one in rows)])[:-1]
        table = self.words(flat, torch.from_numpy(ends), per_sample_weights=weights)
        number = {kind: n for n, kind in enumerate(kinds)}
        index = [[number[token] for token in sentence] for sentence in sentences]
        return table[torch.tensor(index)]


def exported(network: Reader) -> dict[str, Any]:
    """Return the arrays of a network, float16, by the names that inference knows."""
    return {
        name: value.detach().numpy().astype(np.float16)
        for name, value in network.state_dict().items()
    }
