"""The networks in torch, and their file for the inference in numpy."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import torch
from llm_astar_planner.instructions.reader.lifting import SIGN, slot_name
from llm_astar_planner.instructions.reader.meaning import TOKENS
from llm_astar_planner.instructions.reader.network import BUCKETS, SCALE, features
from torch import nn

Sentences = Sequence[Sequence[str]]

NUMBER = {token: n for n, token in enumerate(TOKENS)}
# Tokens beside those of meanings: what is before the first one, and what pads.
BEGIN = len(TOKENS)
# Share of the words that are known by their parts alone, so that new ones are nothing new.
UNKNOWN_WORDS = 0.08


class Words(nn.Module):
    """Embeds tokens, and reads sentences of one length by two layers of a bidirectional GRU."""

    def __init__(self, word: int, size: int) -> None:
        """Begin with random weights."""
        super().__init__()
        self.words = nn.EmbeddingBag(BUCKETS, word, mode='sum')
        nn.init.normal_(self.words.weight, std=0.3)
        self.encoder = nn.GRU(
            word, size, num_layers=2, bidirectional=True, batch_first=True, dropout=0.15
        )
        self.drop = nn.Dropout(0.2)

    def encoded(self, sentences: Sentences) -> torch.Tensor:
        """Return the states [n, length, 2 * size] of sentences of one length."""
        encoded, _ = self.encoder(self.drop(self.embedded(sentences)))
        return self.drop(encoded)

    def embedded(self, sentences: Sentences) -> torch.Tensor:
        """Return the embeddings [n, length, word] of sentences of one length."""
        kinds = list({token for sentence in sentences for token in sentence})
        rows = [features(kind) for kind in kinds]
        if self.training:
            without = torch.rand(len(kinds)) < UNKNOWN_WORDS
            rows = [
                row[1:] if drop and len(row) > 2 and kind[0] != SIGN else row
                for kind, row, drop in zip(kinds, rows, without)
            ]
        flat = torch.tensor([row for one in rows for row, _ in one])
        weights = torch.tensor([weight for one in rows for _, weight in one])
        ends = np.cumsum([0, *(len(one) for one in rows)])[:-1]
        table = self.words(flat, torch.from_numpy(ends), per_sample_weights=weights)
        number = {kind: n for n, kind in enumerate(kinds)}
        index = [[number[token] for token in sentence] for sentence in sentences]
        return table[torch.tensor(index)]


class Reader(Words):
    """Writes the meaning of a lifted sentence by another GRU, a token at a time."""

    def __init__(self, word: int = 64, size: int = 144, decoder: int = 208) -> None:
        """Begin with random weights."""
        super().__init__(word, size)
        self.start = nn.Linear(2 * size, decoder)
        self.tokens = nn.Embedding(len(TOKENS) + 1, 48)
        self.decoder = nn.GRU(48, decoder, batch_first=True)
        self.query = nn.Linear(decoder, 2 * size, bias=False)
        self.mix = nn.Linear(decoder + 2 * size, decoder)
        self.out = nn.Linear(decoder, len(TOKENS))

    def forward(self, sentences: Sentences, previous: torch.Tensor) -> torch.Tensor:
        """Return logits [n, steps, tokens] for sentences of one length and the tokens before."""
        encoded = self.encoded(sentences)
        first = torch.tanh(self.start(encoded.mean(1)))
        states, _ = self.decoder(self.drop(self.tokens(previous)), first[None].contiguous())
        scores = self.query(states) @ encoded.transpose(1, 2)
        context = torch.softmax(scores, -1) @ encoded
        return self.out(self.drop(torch.tanh(self.mix(torch.cat((states, context), -1)))))


class Checker(Words):
    """Tells whether a meaning is that of a sentence: each is read in the light of the other."""

    def __init__(self, word: int = 64, size: int = 112, inner: int = 128) -> None:
        """Begin with random weights."""
        super().__init__(word, size)
        self.view = nn.Linear(2 * size, inner)
        self.tokens = nn.Embedding(len(TOKENS) + 1, 48)
        self.meaning = nn.GRU(48 + inner, inner // 2, bidirectional=True, batch_first=True)
        self.query = nn.Linear(inner, inner, bias=False)
        self.sentence_side = nn.Linear(3 * inner, inner)
        self.meaning_side = nn.Linear(3 * inner, inner)
        self.mix = nn.Linear(4 * inner, inner)
        self.out = nn.Linear(inner, 1)

    def forward(
        self, sentences: Sentences, meanings: Sequence[Sequence[Sequence[str]]]
    ) -> torch.Tensor:
        """Return logits [n, k] for sentences of one length with k meanings each."""
        many = len(meanings[0])
        code = self.view(self.encoded(sentences)).repeat_interleave(many, 0)
        flat = [meaning for some in meanings for meaning in some]
        lengths = torch.tensor([len(meaning) + 1 for meaning in flat])
        index = torch.full((len(flat), int(lengths.max())), BEGIN)
        links = torch.zeros(len(flat), index.shape[1], code.shape[1])
        for n, meaning in enumerate(flat):
            index[n, : len(meaning) + 1] = torch.tensor([*(NUMBER[t] for t in meaning), 0])
            spots = places_of(sentences[n // many])
            for step, token in enumerate(meaning):
                for spot in spots.get(token, ()):
                    links[n, step, spot] = 1.0 / len(spots[token])
        inputs = torch.cat((self.drop(self.tokens(index)), links @ code), -1)
        packed = nn.utils.rnn.pack_padded_sequence(
            inputs, lengths, batch_first=True, enforce_sorted=False
        )
        states, _ = nn.utils.rnn.pad_packed_sequence(
            self.meaning(packed)[0], batch_first=True, total_length=index.shape[1]
        )
        mask = torch.arange(index.shape[1])[None] < lengths[:, None]
        scores = self.query(states) @ code.transpose(1, 2)
        read = torch.softmax(scores, -1) @ code
        there = scores.masked_fill(~mask[:, :, None], -1e9)
        told = torch.softmax(there, 1).transpose(1, 2) @ states
        mine = torch.tanh(
            self.meaning_side(self.drop(torch.cat((states, read, states * read), -1)))
        )
        other = torch.tanh(self.sentence_side(self.drop(torch.cat((code, told, code * told), -1))))
        low = mine.masked_fill(~mask[:, :, None], -1.0).amax(1)
        mean = (mine * mask[:, :, None]).sum(1) / lengths[:, None]
        pooled = torch.cat((low, mean, other.amax(1), other.mean(1)), -1)
        logits = self.out(self.drop(torch.tanh(self.mix(self.drop(pooled)))))
        return logits.view(len(sentences), many)


def places_of(sentence: Sequence[str]) -> dict[str, list[int]]:
    """Return where the slots of a sentence stand, by their names in the meaning."""
    found: dict[str, list[int]] = {}
    for at, token in enumerate(sentence):
        if token[0] == SIGN:
            found.setdefault(slot_name(token), []).append(at)
    return found


def exported(network: nn.Module) -> dict[str, Any]:
    """Return the arrays of a network by the names that inference knows.

    Tables are whole numbers of one byte with a scale for each row, the others float16.
    """
    found: dict[str, Any] = {}
    for name, value in network.state_dict().items():
        array = value.detach().numpy()
        if array.ndim == 2:
            scale = np.abs(array).max(axis=1, keepdims=True) / 127.0 + 1e-12
            found[name + SCALE] = scale.astype(np.float32)
            found[name] = np.rint(array / scale).astype(np.int8)
        else:
            found[name] = array.astype(np.float16)
    return found
