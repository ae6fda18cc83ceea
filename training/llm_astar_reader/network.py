"""The networks in torch, and their file for the inference in numpy."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import torch
from llm_astar_planner.instructions.reader.encoder import spelt
from llm_astar_planner.instructions.reader.lifting import SIGN, slot_name
from llm_astar_planner.instructions.reader.meaning import TOKENS
from llm_astar_planner.instructions.reader.network import BUCKETS, SCALE, features
from torch import nn

from llm_astar_reader.pretrained import Encoder, four_bits

Sentences = Sequence[Sequence[str]]
# Of each sentence some meanings.
Meanings = Sequence[Sentences]

NUMBER = {token: n for n, token in enumerate(TOKENS)}
# Tokens beside those of meanings: what is before the first one, and what pads.
BEGIN = len(TOKENS)
# Share of the words that are known by their parts alone, so that new ones are nothing new.
UNKNOWN_WORDS = 0.08
# The score of what is not there.
MASKED = -1e4


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

    def __init__(self, word: int = 64, size: int = 112, decoder: int = 160) -> None:
        """Begin with random weights."""
        super().__init__(word, size)
        add_decoder(self, 2 * size, decoder)

    def forward(
        self, sentences: Sentences, previous: torch.Tensor, _: object = None
    ) -> torch.Tensor:
        """Return logits [n, steps, tokens] for sentences of one length and the tokens before."""
        states = self.encoded(sentences)
        return decoded(self, states, torch.ones(states.shape[:2], dtype=torch.bool), previous)


class Pretrained(Encoder):
    """Writes the meaning of a sentence that MiniLM has read, and checks meanings of it."""

    def __init__(self, decoder: int = 256) -> None:
        """Begin with random weights; `with_minilm` takes those of MiniLM."""
        super().__init__()
        add_decoder(self, self.size, decoder)
        self.checker = Checker(self.size)

    def forward(
        self, sentences: Sentences, previous: torch.Tensor, meanings: Meanings
    ) -> tuple[torch.Tensor, torch.Tensor]:
        """Return logits [n, steps, tokens] of the next tokens, and [n, k] of k meanings each."""
        states, mask = self.encoded(sentences)
        return decoded(self, states, mask, previous), self.checker(
            states, mask, [spelt(one, self.known) for one in sentences], meanings
        )


def add_decoder(network: nn.Module, size: int, decoder: int) -> None:
    """Give a network of states [n, length, size] the parts that write a meaning."""
    network.start = nn.Linear(size, decoder)
    network.tokens = nn.Embedding(len(TOKENS) + 1, 48)
    network.decoder = nn.GRU(48, decoder, batch_first=True)
    network.query = nn.Linear(decoder, size, bias=False)
    network.mix = nn.Linear(decoder + size, decoder)
    network.out = nn.Linear(decoder, len(TOKENS))
    network.rest = nn.Dropout(0.2)


def decoded(
    network: Any, states: torch.Tensor, mask: torch.Tensor, previous: torch.Tensor
) -> torch.Tensor:
    """Return logits [n, steps, tokens] for states [n, length, size] and the tokens before."""
    shown = mask[:, :, None].to(states.dtype)
    first = torch.tanh(network.start((states * shown).sum(1) / shown.sum(1)))
    steps, _ = network.decoder(network.rest(network.tokens(previous)), first[None].contiguous())
    scores = network.query(steps) @ states.transpose(1, 2)
    context = torch.softmax(scores.masked_fill(~mask[:, None], MASKED), -1) @ states
    mixed = torch.tanh(network.mix(torch.cat((steps, context), -1)))
    return network.out(network.rest(mixed))


class Checker(nn.Module):
    """Tells whether a meaning is that of a sentence: each is read in the light of the other."""

    def __init__(self, size: int, inner: int = 128) -> None:
        """Begin with random weights, for states of a size."""
        super().__init__()
        self.view = nn.Linear(size, inner)
        self.tokens = nn.Embedding(len(TOKENS) + 1, 48)
        self.meaning = nn.GRU(48 + inner, inner // 2, bidirectional=True, batch_first=True)
        self.query = nn.Linear(inner, inner, bias=False)
        self.sentence_side = nn.Linear(3 * inner, inner)
        self.meaning_side = nn.Linear(3 * inner, inner)
        self.mix = nn.Linear(4 * inner, inner)
        self.out = nn.Linear(inner, 1)
        self.drop = nn.Dropout(0.2)

    def forward(
        self, states: torch.Tensor, mask: torch.Tensor, shown: Sentences, meanings: Meanings
    ) -> torch.Tensor:
        """Return logits [n, k] for the states of sentences in pieces with k meanings each."""
        many = len(meanings[0])
        code = self.view(states).repeat_interleave(many, 0)
        there = mask.repeat_interleave(many, 0)
        flat = [meaning for some in meanings for meaning in some]
        lengths = torch.tensor([len(meaning) + 1 for meaning in flat])
        index = torch.full((len(flat), int(lengths.max())), BEGIN)
        links = torch.zeros(len(flat), index.shape[1], code.shape[1])
        for n, meaning in enumerate(flat):
            index[n, : len(meaning) + 1] = torch.tensor([*(NUMBER[t] for t in meaning), 0])
            spots = places_of(shown[n // many])
            for step, token in enumerate(meaning):
                for spot in spots.get(token, ()):
                    links[n, step, spot] = 1.0 / len(spots[token])
        index, links = index.to(code.device), links.to(code.device)
        inputs = torch.cat((self.drop(self.tokens(index)), links @ code), -1)
        packed = nn.utils.rnn.pack_padded_sequence(
            inputs, lengths, batch_first=True, enforce_sorted=False
        )
        steps, _ = nn.utils.rnn.pad_packed_sequence(
            self.meaning(packed)[0], batch_first=True, total_length=index.shape[1]
        )
        said = (torch.arange(index.shape[1])[None] < lengths[:, None]).to(code.device)
        scores = self.query(steps) @ code.transpose(1, 2)
        read = torch.softmax(scores.masked_fill(~there[:, None], MASKED), -1) @ code
        told = torch.softmax(scores.masked_fill(~said[:, :, None], MASKED), 1)
        told = told.transpose(1, 2) @ steps
        sides = [
            pooled(torch.tanh(side(self.drop(torch.cat((mine, other, mine * other), -1)))), seen)
            for side, mine, other, seen in (
                (self.meaning_side, steps, read, said),
                (self.sentence_side, code, told, there),
            )
        ]
        logits = self.out(self.drop(torch.tanh(self.mix(self.drop(torch.cat(sides, -1))))))
        return logits.view(len(shown), many)


def pooled(states: torch.Tensor, mask: torch.Tensor) -> torch.Tensor:
    """Return the greatest and the mean [n, 2 * size] of the states that are there."""
    shown = mask[:, :, None]
    mean = (states * shown).sum(1) / shown.sum(1)
    return torch.cat((states.masked_fill(~shown, -1.0).amax(1), mean), -1)


def places_of(sentence: Sequence[str]) -> dict[str, list[int]]:
    """Return where the slots of a sentence stand, by their names in the meaning."""
    found: dict[str, list[int]] = {}
    for at, token in enumerate(sentence):
        if token[0] == SIGN:
            found.setdefault(slot_name(token), []).append(at)
    return found


def exported(network: nn.Module) -> dict[str, Any]:
    """Return the arrays of a network by the names that inference knows.

    Tables are whole numbers of one byte with a scale for each row, those of the pretrained layers
    of four bits with a scale for each group; the others are float16.
    """
    found: dict[str, Any] = {}
    for name, value in network.state_dict().items():
        array = value.detach().cpu()
        if name == 'word.weight' or (name.startswith('layers.') and array.ndim == 2):
            numbers, scales = four_bits(array)
            low, high = (numbers.flatten(1) + 8).to(torch.uint8).unflatten(1, (-1, 2)).unbind(-1)
            found[name + SCALE] = scales[:, :, 0].numpy().astype(np.float16)
            found[name] = (low | high << 4).numpy()
        elif array.ndim == 2:
            table = array.numpy()
            scale = np.abs(table).max(axis=1, keepdims=True) / 127.0 + 1e-12
            found[name + SCALE] = scale.astype(np.float32)
            found[name] = np.rint(table / scale).astype(np.int8)
        else:
            found[name] = array.numpy().astype(np.float16)
    return found
