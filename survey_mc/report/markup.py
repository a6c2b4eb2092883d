"""HTML by hand, safe by default: every text is escaped unless it is already markup."""

from __future__ import annotations

import html
from collections.abc import Iterable


class Html(str):
    """Finished markup; plain strings are texts."""

    __slots__ = ()


VOID = frozenset({"meta", "img", "br", "hr"})


def text(value: object) -> Html:
    """A value as markup: escaped, unless it is markup."""
    return value if isinstance(value, Html) else Html(html.escape(str(value), quote=True))


def tag(name: str, *children: object, **attributes: str) -> Html:
    """An element; attribute names lose a trailing underscore (class_) and have inner ones as hyphens."""
    pairs = "".join(
        f' {key.rstrip("_").replace("_", "-")}="{html.escape(value, quote=True)}"' for key, value in attributes.items()
    )
    if name in VOID:
        return Html(f"<{name}{pairs}>")
    return Html(f"<{name}{pairs}>{''.join(text(child) for child in children)}</{name}>")


def join(parts: Iterable[object], between: str = "") -> Html:
    """Parts one after the other."""
    return Html(text(between).join(text(part) for part in parts))
