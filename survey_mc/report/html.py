"""The report: one self-contained page that needs no network.

Idea     figures are embedded, the style is inside, scripts are forbidden by the page itself. All text from people
         (names, labels, the campaign file) is escaped.
Limits   links to the tables are relative: they work while the page stays in its run directory.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from survey_mc.report.classification_section import classification_section
from survey_mc.report.definitions import DEFINITIONS
from survey_mc.report.field_process import FieldFigures
from survey_mc.report.figures.style import Figure
from survey_mc.report.headline import headline_table, notices
from survey_mc.report.markup import Html, join, tag
from survey_mc.report.page_shell import Section, heading, page, plain_table
from survey_mc.report.source import RunSource
from survey_mc.report.table_columns import CPU_SECONDS, REPORT_TABLES

if TYPE_CHECKING:
    from pandas import DataFrame


def report_page(
    source: RunSource,
    tables: Mapping[str, DataFrame],
    figures: Sequence[Figure],
    pictures: FieldFigures,
    campaign_text: str = "",
) -> str:
    """The page as text. figures: from the tables; pictures: of one field."""
    name = str(source.lock.get("name", "survey_mc run"))
    drawn = tuple((f"figure-{figure.name}", figure.title) for figure in figures)
    sections = (
        Section("glance", "At a glance", _glance(source, tables)),
        Section("classification", "Point or extended", classification_section(source, tables)),
        Section("figures", "Figures", join(_figure(f) for f in figures), drawn),
        Section("field", "One field", _one_field(pictures)),
        Section("definitions", "What the words mean", _definitions()),
        Section("methods", "Methods", _methods(source.lock)),
        Section("tables", "Tables", _tables(tables)),
        Section("provenance", "Provenance", _provenance(source.lock, campaign_text)),
    )
    return page(f"{name} – survey_mc report", _header(source, name), sections)


def _header(source: RunSource, name: str) -> Html:
    lock = source.lock
    facts = {
        "cells": len(source.cells),
        "methods": len(source.methods),
        "fields asked for": sum(cell.realisations for cell in source.cells),
        "seed": lock.get("seed", "–"),
        "survey_mc": lock.get("versions", {}).get("survey_mc", "–"),
    }
    return heading(name, str(lock.get("about", "")), facts)


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


def _one_field(pictures: FieldFigures) -> Html:
    if pictures.problem:
        return tag("p", f"It could not be drawn: {pictures.problem}.")
    return join(_figure(figure) for figure in pictures.figures)


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
        rows.append((method.get("label", ""), procedure, method.get("reference", ""), tag("code", params)))
    if not rows:
        return Html("")
    note = tag("p", "Procedures are re-implementations from their publications, not the original programs.")
    return join([note, plain_table(("label", "procedure", "reference", "parameters"), rows)])


def _tables(tables: Mapping[str, DataFrame]) -> Html:
    rows = [(t.name, t.about, len(tables[t.name]), _table_links(t.name)) for t in REPORT_TABLES]
    note = tag("p", "Units and meanings of the columns are in the Parquet metadata and in the first lines of the CSV.")
    return join([note, plain_table(("table", "holds", "rows", "files"), rows)])


def _provenance(lock: Mapping[str, Any], campaign_text: str) -> Html:
    versions = ", ".join(f"{name} {version}" for name, version in lock.get("versions", {}).items())
    parts = [tag("p", "Made with ", versions or "unknown versions", "; seed ", lock.get("seed", "unknown"), ".")]
    if campaign_text:
        parts.append(tag("details", tag("summary", "Campaign file"), tag("pre", campaign_text), open="open"))
    return join(parts)
