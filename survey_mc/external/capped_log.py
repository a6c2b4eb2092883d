"""What a program prints, in bounded memory: the beginning and the end."""

from __future__ import annotations

N_LAST_LINES = 3
MAX_LINE = 200  # characters of a line in a sentence


class CappedLog:
    """Bytes as they come; half of `bytes_max` are kept from the beginning, half from the end."""

    def __init__(self, bytes_max: int) -> None:
        self._half = max(1, bytes_max // 2)
        self._head, self._tail = bytearray(), bytearray()
        self.n_bytes = 0

    def add(self, piece: bytes) -> None:
        self.n_bytes += len(piece)
        room = self._half - len(self._head)
        self._head += piece[:room]
        self._tail += piece[room:]
        if len(self._tail) > 2 * self._half:  # not at every piece: the rest has to be moved
            del self._tail[: -self._half]

    def text(self) -> str:
        """As text, whatever its encoding; a line in brackets stands for what was left out."""
        tail = self._tail[-self._half :]
        n_lost = self.n_bytes - len(self._head) - len(tail)
        gap = f"\n[… {n_lost} bytes left out …]\n" if n_lost else ""
        return self._head.decode("utf-8", "replace") + gap + tail.decode("utf-8", "replace")

    def last_words(self) -> str:
        """The last lines as part of a sentence."""
        lines = [line.strip() for line in self.text().splitlines() if line.strip()]
        if not lines:
            return "it printed nothing"
        shown = " / ".join(line[:MAX_LINE] for line in lines[-N_LAST_LINES:])
        return "its last words: " + "".join(c if c.isprintable() else "?" for c in shown)
