"""Text that a file or a stranger may have given, as it can be shown on a terminal: no control characters."""

from __future__ import annotations


def shown(text: str) -> str:
    """One line; what cannot be printed, line ends and reversed writing among it, as an escape."""
    return text if text.isprintable() else "".join(c if c.isprintable() else ascii(c)[1:-1] for c in text)
