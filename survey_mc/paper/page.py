"""The page of the study: what was reproduced, number by number, and every figure.

Idea     one table for each table or section of the paper, published number beside ours, with verdict and cause; the
         figures beside the page as PNG and PDF.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from survey_mc.paper.choices import CHOICES
from survey_mc.paper.detected_clusters import detected_clusters
from survey_mc.paper.lacking import lacking_fields
from survey_mc.paper.results import StudyResults
from survey_mc.paper.study import TEST_3, TEST_4
from survey_mc.paper.verdict import RULE
from survey_mc.report.classification_section import classification_section
from survey_mc.report.markup import Html, join, tag
from survey_mc.report.numbers import DASH, between, plain, power
from survey_mc.report.page_shell import FILES_BESIDE, Section, heading, page, plain_table

if TYPE_CHECKING:
    from pandas import DataFrame

PAPER = "Valtchanov, Pierre & Gastaud 2001, A&A 370, 689"
HEADLINE = "headline"  # the figure that stands first
SMALL = 1e-3
VERDICTS = ("reproduced", "differs", "not comparable")
COLUMNS = ("quantity", "method", "published", "ours", "68 %", "n", "verdict", "cause")
FOLDED_ROWS = 20  # longer groups start folded


def study_page(results: StudyResults, scorecard: DataFrame, figures: Sequence[tuple[str, str, str]]) -> str:
    """The page as text. figures: (name, title, caption) of the files in `figures/`."""
    header = heading(
        "The paper, reproduced",
        f"Every published number of {PAPER}, beside the same statistic of our simulations.",
        {
            "campaigns": len(results.campaigns),
            "fields": sum(_n_fields(results, c.name) for c in results.campaigns),
            "published numbers": len(scorecard),
            **{verdict: int((scorecard["verdict"] == verdict).sum()) for verdict in VERDICTS},
        },
    )
    groups = list(dict.fromkeys(scorecard["where"]))
    anchors = tuple((f"rows-{place}", where) for place, where in enumerate(groups))
    tables = [
        _group(anchor, where, scorecard[scorecard["where"] == where])
        for (anchor, _), where in zip(anchors, groups, strict=True)
    ]
    drawn = tuple((f"figure-{name}", title) for name, title, _ in figures if name != HEADLINE)
    sections = (
        Section("summary", "Summary", join([*(_figure(*f) for f in figures if f[0] == HEADLINE), _summary(scorecard)])),
        Section("scorecard", "Number by number", join(tables), anchors),
        Section("clusters", "Clusters detected", detected_clusters(results)),
        Section("classification", "Point or extended", _classification(results)),
        Section("figures", "Figures", join(_figure(*f) for f in figures if f[0] != HEADLINE), drawn),
        Section("rule", "How a verdict is made", join(tag("p", paragraph) for paragraph in RULE)),
        Section("choices", "How choices were made", join(tag("p", paragraph) for paragraph in CHOICES)),
        Section("campaigns", "Campaigns", _campaigns(results)),
    )
    return page("The paper, reproduced – survey_mc", header, sections, FILES_BESIDE)


def _summary(scorecard: DataFrame) -> Html:
    computed = scorecard["sampling"] == "computed"
    parts = [("computed constants (the simulator's own inputs among them)", scorecard[computed])]
    drawn = scorecard[~computed]
    parts += [(where, drawn[drawn["where"] == where]) for where in dict.fromkeys(drawn["where"])]
    parts += [("all that is drawn", drawn), ("all", scorecard)]
    rows = [[name, len(part), *(int((part["verdict"] == v).sum()) or DASH for v in VERDICTS)] for name, part in parts]
    files = (tag("a", name, href=name) for name in ("scorecard.csv", "scorecard.parquet", "option_effects.csv"))
    return join(
        [plain_table(("place", "numbers", *VERDICTS), rows), tag("p", "Files: ", join(files, between=", "), ".")]
    )


def _group(anchor: str, where: str, rows: DataFrame) -> Html:
    table = plain_table(COLUMNS, [_cells(row) for row in rows.to_dict("records")])
    title = tag("h3", where, id=anchor)
    if len(rows) > FOLDED_ROWS:
        return join([title, tag("details", tag("summary", f"{len(rows)} numbers"), table)])
    return join([title, table])


def _classification(results: StudyResults) -> Html:
    """The confusion matrices of Test 4 and of its point-only fields."""
    parts = []
    for campaign, title in ((TEST_4, "Test 4, points and clusters"), (TEST_3, "Test 3, points alone")):
        if results.has(campaign) and "classification" in results.run(campaign).tables:
            run = results.run(campaign)
            section = classification_section(run.data, {"classification": run.table("classification")})
            parts += [tag("h3", title), section] if section else []
    return join(parts)


def _cells(row: dict[str, Any]) -> list[object]:
    unit = f" {row['unit']}" if row["unit"] else ""
    median, interval = _value(row["median"], row["lower_68"], row["upper_68"])
    quantity = join([row["quantity"], tag("br"), tag("small", row["statistic"])])
    where = join([row["method"] or DASH, tag("br"), tag("small", row["condition"])])
    verdict = join([tag("b", row["verdict"]), tag("br"), tag("small", row["reason"])])
    cause = _cause(row)
    drawn = f"{row['n']} groups" if row["sampling"] == "groups of ten fields" else row["n"]
    return [
        quantity,
        where,
        f"{row['published']}{unit}",
        median,
        interval,
        drawn if row["n"] else DASH,
        verdict,
        cause or DASH,
    ]


def _cause(row: dict[str, Any]) -> Html:
    """The named option with what our median becomes, and how far it explains."""
    words = str(row["effect"])
    if row["cause"]:
        words += f"; median {_value(row['cause_median'], math.nan, math.nan)[0]}"
    return join([part for part in (row["cause"], words and tag("small", words)) if part], tag("br"))


def _value(value: float, lower: float, upper: float) -> tuple[str, str]:
    if math.isfinite(value) and 0.0 < abs(value) < SMALL:
        return power(value, lower, upper)
    return plain(value), between(lower, upper)


def _figure(name: str, title: str, caption: str) -> Html:
    picture = tag("img", src=f"figures/{name}.png", alt=f"{title}. {caption}", loading="lazy")
    links = join([tag("a", kind.upper(), href=f"figures/{name}.{kind}") for kind in ("png", "pdf")], between=", ")
    return join(
        [
            tag("h3", title, id=f"figure-{name}"),
            tag("figure", picture, tag("figcaption", caption, " ", links, ".")),
        ]
    )


def _campaigns(results: StudyResults) -> Html:
    rows: list[list[object]] = []
    for campaign in results.campaigns:
        lock = results.run(campaign.name).data.lock
        link = tag("a", campaign.name, href=f"{campaign.name}/campaign.toml")
        locked = tag("a", "lock file", href=f"{campaign.name}/campaign.lock.json")
        lacking = lacking_fields(results, campaign.name)
        about = join([lock.get("about", ""), *([tag("br"), tag("b", lacking)] if lacking else [])])
        rows.append([link, about, _n_fields(results, campaign.name), lock.get("seed", DASH), locked])
    versions: dict[str, str] = results.run(results.campaigns[0].name).data.lock.get("versions", {})
    made = tag("p", "Made with ", ", ".join(f"{name} {version}" for name, version in versions.items()), ".")
    return join([plain_table(("campaign", "what it is", "fields", "seed", "resolved"), rows), made])


def _n_fields(results: StudyResults, campaign: str) -> int:
    return sum(cell.realisations for cell in results.run(campaign).data.cells)
