"""The one table to look at first: methods by cells."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING

from survey_mc.report.markup import Html, join, tag, text
from survey_mc.report.numbers import DASH, plain, power, with_interval
from survey_mc.report.source import CellLike, RunSource
from survey_mc.stats.selections import NAMED

if TYPE_CHECKING:
    from pandas import DataFrame, Series

LEVEL = 0.9
ENOUGH_FIELDS = 10  # fewer say nothing about the variance between fields
DESIGN_EFFECT_MAX = 1.3
EXTENDED = ("extended found", "of those listed")
BRIGHT, EVERY = NAMED[1], NAMED[0]  # more than 50 input counts; all, where none is that bright
FALSE_KINDS = ("false", "spurious")
COLUMNS = (
    ("method", ""),
    ("fields", ""),
    EXTENDED,
    ("90 % limit", "erg cm⁻² s⁻¹"),
    ("90 % limit", "expected counts"),
    ("false", "per field"),
    ("of these spurious", "per field"),
    ("measured / true flux", "median (16 … 84 %)"),
    ("position error", "68 %, arcsec"),
    ("CPU", "s per field"),
)


def headline_table(source: RunSource, tables: Mapping[str, DataFrame]) -> Html:
    """Every method in every cell, by the campaign's headline rule; without extended sources no column for them."""
    has_extended = bool((tables["completeness"]["kind"] == "extended").any())
    columns = [c for c in COLUMNS if has_extended or c != EXTENDED]
    titles = [
        tag("th", name, join([tag("br"), tag("small", unit)]) if unit else "", scope="col") for name, unit in columns
    ]
    bodies = [_cell_rows(source, tables, cell, has_extended) for cell in source.cells]
    return tag("div", tag("table", tag("thead", tag("tr", *titles)), *bodies, class_="headline"), class_="wide")


def _cell_rows(source: RunSource, tables: Mapping[str, DataFrame], cell: CellLike, has_extended: bool) -> Html:
    title = tag("th", cell_phrase(cell), colspan=str(len(COLUMNS) - (not has_extended)), scope="rowgroup")
    rows = [
        tag(
            "tr",
            tag("th", method.label, scope="row"),
            *(tag("td", value) for value in _values(tables, cell, method.label, has_extended)),
        )
        for method in source.methods
    ]
    return tag("tbody", tag("tr", title, class_="group"), *rows)


def cell_phrase(cell: CellLike) -> str:
    """A cell in words."""
    return (
        f"{cell.label}: {cell.instrument}, {cell.band} band, {cell.exposure_ks:g} ks, sources of at least "
        f"{cell.counts_min:g} counts within {cell.region_arcmin:g}′, {rule_phrase(cell)}"
    )


def rule_phrase(cell: CellLike) -> str:
    """The headline rule in words."""
    if cell.rule == "nearest":
        return f"matched to the nearest within {cell.radius_arcsec:g}″"
    return "matched by the origin of the photons"


def _values(tables: Mapping[str, DataFrame], cell: CellLike, label: str, has_extended: bool) -> list[Html]:
    """The values of a row after its label; of point sources, where the cell has both kinds."""

    def rows(name: str, **where: object) -> DataFrame:
        frame = tables[name]
        for column, value in {"cell": cell.label, "method": label, "rule": cell.rule, **where}.items():
            frame = frame[frame[column] == value]
        return frame

    false = _first(rows("false_detections"))
    if false is None:
        return [text("none done"), *[text(DASH)] * (len(COLUMNS) - 2 - (not has_extended))]
    kind = "point" if len(rows("completeness", kind="point")) else "all"
    flux = _first(rows("completeness_limit", level=LEVEL, quantity="flux_true_cgs", kind=kind))
    counts = _first(rows("completeness_limit", level=LEVEL, quantity="counts_expected", kind=kind))
    ratio = _bright(rows("photometry", ratio="flux / flux_true", kind=kind))
    position = _bright(rows("astrometry", kind=kind))
    return [
        text(false["n_fields"]),
        *([_found(rows("status_counts", kind="extended"))] if has_extended else []),
        _limit(flux, power),
        _limit(counts, with_interval),
        *(
            _cell(false, f"{name}_per_field", f"{name}_per_field_lower", f"{name}_per_field_upper")
            for name in FALSE_KINDS
        ),
        _cell(ratio, "median", "q16", "q84"),
        _cell(position, "one_sigma_arcsec", "one_sigma_lower_arcsec", "one_sigma_upper_arcsec"),
        _cpu(tables["cpu_seconds"], cell, label),
    ]


def _found(counts: DataFrame) -> Html:
    """How many of the extended sources are matched."""
    n = counts.set_index("status")["n"]
    found, missed = int(n.get("matched", 0)), int(n.get("missed", 0))
    return text(f"{found} of {found + missed}" if found + missed else DASH)


def _stacked(value: str, interval: str) -> Html:
    """A value with its interval below it."""
    return join([value, tag("br"), tag("small", interval)]) if interval else text(value)


def _cell(row: Series | None, value: str, lower: str, upper: str) -> Html:
    if row is None:
        return text(DASH)
    number, interval = with_interval(row[value], row[lower], row[upper])
    return _stacked(number + _mark(row), interval)


def _first(frame: DataFrame) -> Series | None:
    return frame.iloc[0] if len(frame) else None


def _bright(frame: DataFrame) -> Series | None:
    """The row of sources above 50 counts, else of all."""
    for selection in (BRIGHT, EVERY):
        found = _first(frame[frame["selection"] == selection])
        if found is not None:
            return found
    return None


def _mark(row: Series) -> str:
    """An asterisk for values of all sources, where none is bright."""
    return " *" if row.get("selection") == EVERY else ""


def _limit(row: Series | None, phrase: Callable[[float, float, float], tuple[str, str]]) -> Html:
    if row is None:
        return text(DASH)
    if row["state"] != "reached":
        return text(row["state"])
    return _stacked(*phrase(row["limit"], row["lower"], row["upper"]))


def _cpu(costs: DataFrame, cell: CellLike, label: str) -> Html:
    row = _first(costs[(costs["cell"] == cell.label) & (costs["method"] == label) & (costs["stage"] == "detect")])
    return text(DASH if row is None else plain(row["cpu_s_per_field"], 2))


def notices(source: RunSource, tables: Mapping[str, DataFrame]) -> Sequence[str]:
    """What a reader must know before believing the numbers."""
    sentences = []
    false = tables["false_detections"]
    for cell in source.cells:
        done = false[(false["cell"] == cell.label) & (false["rule"] == cell.rule)].set_index("method")["n_fields"]
        for method in source.methods:
            n_fields = int(done.get(method.label, 0))
            if n_fields < cell.realisations:
                sentences.append(
                    f"{method.label} in {cell.label}: {n_fields} of {cell.realisations} fields are done "
                    "(the rest is missing, failed or skipped)."
                )
    completeness = tables["completeness"]
    effect = completeness.loc[completeness["n_fields"] >= ENOUGH_FIELDS, "design_effect"].median()
    if effect > DESIGN_EFFECT_MAX:
        sentences.append(
            f"The completeness varies between fields more than independent sources would (median design effect "
            f"{effect:.2f}): prefer the intervals from resampled fields (lower_fields, upper_fields)."
        )
    return sentences
