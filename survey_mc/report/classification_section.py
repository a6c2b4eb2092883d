"""The classification of a run in one table for people: the confusion matrix of every statistic at its usual cut."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

from survey_mc.report.classified import BRIGHT_CENTRAL
from survey_mc.report.headline import rule_phrase
from survey_mc.report.markup import Html, join, tag, text
from survey_mc.report.numbers import DASH, plain, with_interval
from survey_mc.report.source import CellLike, RunSource

if TYPE_CHECKING:
    from pandas import DataFrame, Series

COLUMNS = (
    ("method", ""),
    ("called extended if", ""),
    ("extended", "called so, of all detected"),
    ("points", "called extended, of all"),
    ("blends", "called extended, of all"),
    ("spurious", "called extended, of all"),
    ("completeness", "of the extended"),
    ("contamination", "of those called extended"),
    ("area under curve", "0.5 guessing, 1 perfect"),
    ("of those listed", "found and called extended"),
)


def classification_section(source: RunSource, tables: Mapping[str, DataFrame]) -> Html:
    """Every statistic of every method in every cell by the headline rule; nothing for a run without detections."""
    table = tables["classification"]
    table = table[table["selection"] == BRIGHT_CENTRAL]
    bodies = [_cell_rows(cell, table[(table["cell"] == cell.label) & (table["rule"] == cell.rule)])
              for cell in source.cells]  # fmt: skip
    if not any(bodies):
        return Html("")
    titles = [tag("th", name, join([tag("br"), tag("small", unit)]) if unit else "", scope="col")
              for name, unit in COLUMNS]  # fmt: skip
    note = tag(
        "p",
        f"Detections with {BRIGHT_CENTRAL}. What a detection is, its source says; what it is called, the statistic of "
        "its procedure at the usual cut. Second lines: 68 % Jeffreys intervals; those from resampled fields, other "
        "cuts and all detections are in the tables.",
    )
    return join([note, tag("div", tag("table", tag("thead", tag("tr", *titles)), *bodies, class_="headline"),
                           class_="wide")])  # fmt: skip


def _cell_rows(cell: CellLike, rows: DataFrame) -> Html:
    if not len(rows):
        return Html("")
    title = tag("th", f"{cell.label}, {rule_phrase(cell)}", colspan=str(len(COLUMNS)), scope="rowgroup")
    body = [tag("tr", tag("th", row["method"], scope="row"), *(tag("td", value) for value in _values(row)))
            for _, row in rows.iterrows()]  # fmt: skip
    return tag("tbody", tag("tr", title, class_="group"), *body)


def _values(row: Series) -> list[Html]:
    sign = "≥" if row["extended_is"] == "larger" else "<"
    unit = f" {row['unit']}" if row["unit"] else ""
    is_joint = not row["statistic"].isidentifier()
    rule = row["label"] if is_joint else f"{row['statistic']} {sign} {plain(row['cut'])}{unit}"
    numbers = [_of(row, name) for name in ("extended", "point", "blend", "spurious")]
    return [
        text(rule),
        *numbers,
        _rate(row, "completeness"),
        _rate(row, "contamination"),
        _stacked(*with_interval(row["auc"], row["auc_lower_fields"], row["auc_upper_fields"])),
        text(f"{row['n_listed_extended_called']} of {row['n_listed_extended']}" if row["n_listed_extended"] else DASH),
    ]


def _of(row: Series, name: str) -> Html:
    called, not_called = int(row[f"n_{name}_as_extended"]), int(row[f"n_{name}_as_point"])
    return text(f"{called} of {called + not_called}" if called + not_called else DASH)


def _rate(row: Series, name: str) -> Html:
    return _stacked(*with_interval(row[name], row[f"{name}_lower"], row[f"{name}_upper"]))


def _stacked(value: str, interval: str) -> Html:
    return join([value, tag("br"), tag("small", interval)]) if interval else text(value)
