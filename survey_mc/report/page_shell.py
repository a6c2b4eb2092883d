"""The frame of every page we make: style inside, no scripts, a contents list beside the sections.

Idea     a section is an anchor, a title and finished markup; empty ones are left out.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from survey_mc.report.markup import Html, tag
from survey_mc.report.page_style import STYLE

EMBEDDED_ONLY = "img-src data:"
FILES_BESIDE = "img-src 'self' file: data:"


@dataclass(frozen=True, slots=True)
class Section:
    """A section of a page. entries: (anchor, title) of what is listed below it in the contents."""

    anchor: str
    title: str
    content: Html
    entries: tuple[tuple[str, str], ...] = ()


def page(title: str, header: Html, sections: Sequence[Section], images: str = EMBEDDED_ONLY) -> str:
    """A whole page as text. images: what it may show, `EMBEDDED_ONLY` or `FILES_BESIDE`."""
    shown = [section for section in sections if section.content]
    contents = [tag("li", tag("a", s.title, href=f"#{s.anchor}"), _entries(s.entries)) for s in shown]
    body = tag(
        "div",
        tag("nav", tag("strong", "Contents"), tag("ol", *contents), aria_label="Contents"),
        tag("main", header, *(tag("section", tag("h2", s.title), s.content, id=s.anchor) for s in shown)),
        class_="sheet",
    )
    policy = f"default-src 'none'; {images}; style-src 'unsafe-inline'; base-uri 'none'; form-action 'none'"
    head = tag(
        "head",
        tag("meta", charset="utf-8"),
        tag("meta", http_equiv="Content-Security-Policy", content=policy),
        tag("meta", name_="referrer", content="no-referrer"),
        tag("meta", name_="viewport", content="width=device-width, initial-scale=1"),
        tag("meta", name_="color-scheme", content="light dark"),
        tag("title", title),
        tag("style", Html(STYLE)),
    )
    return "<!DOCTYPE html>\n" + tag("html", head, tag("body", body), lang="en") + "\n"


def heading(title: str, about: str, facts: Mapping[str, object]) -> Html:
    """Title, one sentence and a line of facts."""
    items = [tag("li", f"{label} ", tag("b", value)) for label, value in facts.items()]
    lead = tag("p", about, class_="lead") if about else Html("")
    return tag("header", tag("h1", title), lead, tag("ul", *items, class_="facts"))


def plain_table(titles: Sequence[object], rows: Sequence[Sequence[object]]) -> Html:
    """A table of texts; the first cell of a row names it."""
    head = tag("tr", *(tag("th", title, scope="col") for title in titles))
    body = [tag("tr", tag("th", row[0], scope="row"), *(tag("td", cell) for cell in row[1:])) for row in rows]
    return tag("div", tag("table", tag("thead", head), tag("tbody", *body), class_="plain"), class_="wide")


def _entries(entries: Sequence[tuple[str, str]]) -> Html:
    if not entries:
        return Html("")
    return tag("ol", *(tag("li", tag("a", title, href=f"#{anchor}")) for anchor, title in entries))
