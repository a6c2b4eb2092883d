"""HTML by hand, safe by default: every text is escaped unless it is already markup.

Idea     what a reader sees is what is in the text: characters that do not print, or turn the direction of writing, are
         shown as such. A link leads into the page or to a file beside it, whatever the name it is made of.
"""

from __future__ import annotations

import html
import re
import unicodedata
from collections.abc import Iterable


class Html(str):
    """Finished markup; plain strings are texts."""

    __slots__ = ()


VOID = frozenset({"meta", "img", "br", "hr"})
LINKS = frozenset({"href", "src"})
EMBEDDED = "data:image/png;base64,"
_SCHEME_OR_HOST = re.compile(r"\s*(?:[^/?#]*:|[/\\]{2})")
_SPACES = frozenset("\n\t")


def text(value: object) -> Html:
    """A value as markup: escaped, unless it is markup."""
    return value if isinstance(value, Html) else _escaped(str(value))


def _escaped(words: str) -> Html:
    return Html(html.escape(_visible(words), quote=True))


def _visible(words: str) -> str:
    """The same text with a sign for every control and formatting character (Unicode classes Cc, Cf, Cs)."""
    if words.isprintable():
        return words
    return "".join("�" if unicodedata.category(c) in ("Cc", "Cf", "Cs") and c not in _SPACES else c for c in words)


def _local(target: str) -> str:
    """A link that no name can turn into one to somewhere else, or into a script."""
    return f"./{target}" if _SCHEME_OR_HOST.match(target) and not target.startswith(EMBEDDED) else target


def tag(name: str, *children: object, **attributes: str) -> Html:
    """An element; attribute names lose a trailing underscore (class_) and have inner ones as hyphens."""
    pairs = "".join(
        f' {key.rstrip("_").replace("_", "-")}="{_escaped(_local(value) if key in LINKS else value)}"'
        for key, value in attributes.items()
    )
    if name in VOID:
        return Html(f"<{name}{pairs}>")
    return Html(f"<{name}{pairs}>{''.join(text(child) for child in children)}</{name}>")


def join(parts: Iterable[object], between: str = "") -> Html:
    """Parts one after the other."""
    return Html(text(between).join(text(part) for part in parts))
