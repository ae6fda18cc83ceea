"""What was wrong with a bag, in sentences, however much of it there is."""

from __future__ import annotations

from dataclasses import dataclass, field


@dataclass
class Problems:
    """What was wrong with a bag: `notes` cost nothing, what was `left_out` is not in the results.

    Beyond `limit` sentences of a kind only their number is kept.
    """

    limit: int = 20
    notes: list[str] = field(default_factory=list)
    left_out: list[str] = field(default_factory=list)
    more: dict[str, int] = field(default_factory=dict)
    _seen: dict[str, int] = field(default_factory=dict)

    def note(self, sentence: str) -> None:
        """Say what is odd and costs nothing."""
        if sentence not in self.notes and len(self.notes) < self.limit:
            self.notes.append(sentence)

    def leave_out(self, sentence: str, kind: str = '') -> None:
        """Say what is left out and why; `kind` names what all such sentences are about."""
        count = self._seen[kind] = self._seen.get(kind, 0) + 1
        if kind and count > self.limit:
            self.more[kind] = count - self.limit
        elif sentence not in self.left_out:
            self.left_out.append(sentence)

    def lines(self) -> list[str]:
        """Return every sentence on what was left out, those of a kind too many as a number."""
        return [*self.left_out, *(f'{kind}: {count} more' for kind, count in self.more.items())]
