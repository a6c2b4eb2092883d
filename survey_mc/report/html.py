"""The report: one self-contained page that needs no network.

Idea     figures are embedded, the style is inside, scripts are forbidden by the page itself. All text from people
         (names, labels, the campaign file) is escaped.
Limits   links to the tables are relative: they work while the page stays in its run directory.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from survey_mc.report.definitions import DEFINITIONS
from survey_mc.report.figures.style import Figure
from survey_mc.report.headline import headline_table, notices
from survey_mc.report.markup import Html, join, tag
from survey_mc.report.page_style import STYLE
from survey_mc.report.source import RunSource
from survey_mc.report.table_columns import CPU_SECONDS, TABLES

if TYPE_CHECKING:
    from pandas import DataFrame

CONTENT_POLICY = "default-src 'none'; img-src data:; style-src 'unsafe-inline'"


def report_page(
    source: RunSource,
    tables: Mapping[str, DataFrame],
    figures: Sequence[Figure],
    pictures: Sequence[Figure],
    campaign_text: str = "",
) -> str:
    """The page as text. figures: from the tables; pictures: of one field."""
    name = str(source.lock.get("name", "survey_mc run"))
    sections = [
        ("glance", "At a glance", _glance(source, tables)),
        ("figures", "Figures", join(_figure(f) for f in figures)),
        ("field", "One field", join(_figure(f) for f in pictures)),
        ("definitions", "What the words mean", _definitions()),
        ("methods", "Methods", _methods(source.lock)),
        ("tables", "Tables", _tables(tables)),
        ("provenance", "Provenance", _provenance(source.lock, campaign_text)),
    ]
    sections = [section for section in sections if section[2]]
    contents = [
        tag("li", tag("a", title, href=f"#{anchor}"), _sub_contents(figures if anchor == "figures" else ()))
        for anchor, title, _ in sections
    ]
    body = tag(
        "div",
        tag("nav", tag("strong", "Contents"), tag("ol", *contents), aria_label="Contents"),
        tag("main", _header(source, name), *(tag("section", tag("h2", t), c, id=a) for a, t, c in sections)),
        class_="sheet",
    )
    head = tag(
        "head",
        tag("meta", charset="utf-8"),
        tag("meta", http_equiv="Content-Security-Policy", content=CONTENT_POLICY),
        tag("meta", name_="viewport", content="width=device-width, initial-scale=1"),
        tag("meta", name_="color-scheme", content="light dark"),
        tag("title", f"{name} – survey_mc report"),
        tag("style", Html(STYLE)),
    )
    return "<!DOCTYPE html>\n" + tag("html", head, tag("body", body), lang="en") + "\n"


def _header(source: RunSource, name: str) -> Html:
    lock = source.lock
    n_fields = sum(cell.realisations for cell in source.cells)
    facts = {
        "cells": len(source.cells),
        "methods": len(source.methods),
        "fields asked for": n_fields,
        "seed": lock.get("seed", "–"),
        "survey_mc": lock.get("versions", {}).get("survey_mc", "–"),
    }
    items = [tag("li", f"{label} ", tag("b", value)) for label, value in facts.items()]
    about = tag("p", lock["about"], class_="lead") if lock.get("about") else Html("")
    return tag("header", tag("h1", name), about, tag("ul", *items, class_="facts"))


def _glance(source: RunSource, tables: Mapping[str, DataFrame]) -> Html:
    sentences = notices(source, tables)
    notice = Html("")
    if sentences:
        notice = tag("div", "Before you read on:", tag("ul", *(tag("li", s) for s in sentences)), class_="notice",
                     role="note")  # fmt: skip
    explanation = tag(
        "p",
        "The second lines are 68 % intervals, except for the flux ratio, where they hold 68 % of the sources. Flux "
        "ratio and position error are for sources of more than 50 counts on axis (* all matched sources, where none is "
        "that bright). Where there are extended sources, limits, ratio and position error are those of the points. ",
        tag("a", "What the words mean.", href="#definitions"),
    )
    return join([notice, headline_table(source, tables), explanation])


def _figure(figure: Figure) -> Html:
    links = join([_table_links(name) for name in figure.tables], between="; ")
    caption = join([figure.caption, " Numbers: ", links, "."]) if figure.tables else figure.caption
    picture = tag("img", src=figure.data_uri, alt=f"{figure.title}. {figure.caption}")
    return join(
        [tag("h3", figure.title, id=f"figure-{figure.name}"), tag("figure", picture, tag("figcaption", caption))]
    )


def _sub_contents(figures: Sequence[Figure]) -> Html:
    if not figures:
        return Html("")
    return tag("ol", *(tag("li", tag("a", f.title, href=f"#figure-{f.name}")) for f in figures))


def _table_links(name: str) -> Html:
    if name == CPU_SECONDS.name:
        return tag("a", f"{name}.csv", href=f"../runs/{name}.csv")
    links = (tag("a", f"{name}.{kind}", href=f"../tables/{name}.{kind}") for kind in ("csv", "parquet"))
    return join(links, between=", ")


def _definitions() -> Html:
    return tag("dl", *(join([tag("dt", word), tag("dd", meaning)]) for word, meaning in DEFINITIONS))


def _methods(lock: Mapping[str, Any]) -> Html:
    """The lock's methods: what each label stands for, with its parameters."""
    rows = []
    for method in lock.get("methods", ()):
        params = ", ".join(f"{key} = {json.dumps(value)}" for key, value in method.get("params", {}).items())
        procedure = f"{method.get('name', '')} v{method.get('version', '?')}"
        rows.append(
            tag("tr", tag("th", method.get("label", ""), scope="row"), tag("td", procedure),
                tag("td", method.get("reference", "")), tag("td", tag("code", params)))
        )  # fmt: skip
    if not rows:
        return Html("")
    titles = (tag("th", title, scope="col") for title in ("label", "procedure", "reference", "parameters"))
    note = tag("p", "Procedures are re-implementations from their publications, not the original programs.")
    table = tag("table", tag("thead", tag("tr", *titles)), tag("tbody", *rows), class_="plain")
    return join([note, tag("div", table, class_="wide")])


def _tables(tables: Mapping[str, DataFrame]) -> Html:
    rows = [
        tag("tr", tag("th", t.name, scope="row"), tag("td", t.about), tag("td", len(tables[t.name])),
            tag("td", _table_links(t.name)))
        for t in (*TABLES, CPU_SECONDS)
    ]  # fmt: skip
    titles = (tag("th", title, scope="col") for title in ("table", "holds", "rows", "files"))
    note = tag("p", "Units and meanings of the columns are in the Parquet metadata and in the first lines of the CSV.")
    table = tag("table", tag("thead", tag("tr", *titles)), tag("tbody", *rows), class_="plain")
    return join([note, tag("div", table, class_="wide")])


def _provenance(lock: Mapping[str, Any], campaign_text: str) -> Html:
    versions = ", ".join(f"{name} {version}" for name, version in lock.get("versions", {}).items())
    parts = [tag("p", "Made with ", versions or "unknown versions", "; seed ", lock.get("seed", "unknown"), ".")]
    if campaign_text:
        parts.append(tag("details", tag("summary", "Campaign file"), tag("pre", campaign_text), open="open"))
    return join(parts)
