"""Columns of the tables of classification and of chance matches."""

from __future__ import annotations

from survey_mc.columns import Column, Table
from survey_mc.report.common_columns import IDENTITY, fraction, number, rate, value

_STATISTIC = (
    Column("statistic", "string", "column of the detections that tells extents, or the paper's joint cut"),
    Column("label", "string", "what it is"),
    Column("unit", "string", "unit of the statistic; empty if none"),
    Column("selection", "string", "all detections in the region, or the bright and central ones of the paper"),
)
_CLASSES = (
    ("point", "resting on a point source"),
    ("extended", "resting on an extended source, fragments of a split one included"),
    ("blend", "resting on several sources, none of them theirs"),
    ("spurious", "resting on nothing"),
)

CLASSIFICATION = Table("classification", "Point against extended: what detections are and what they are called", (
    *IDENTITY,
    *_STATISTIC,
    value("cut", "the rule's default cut, in the unit of the statistic"),
    Column("extended_is", "string", "larger: called extended at or above the cut; smaller: below it"),
    number("n_unmeasured", "detections without the statistic, which are called point"),
    *(
        number(f"n_{name}_as_{called}", f"detections {about}, called {called}")
        for name, about in _CLASSES
        for called in ("point", "extended")
    ),
    *fraction("completeness", "extended detections called extended, over all extended detections"),
    *fraction("contamination", "called extended and not extended, over all called extended"),
    *fraction("false_extended", "points called extended, over all points"),
    *fraction("wrong", "extended called point and others called extended, over all detections"),
    *rate("contaminants_per_deg2", "called extended and not extended, of a square degree", "1 / deg2"),
    number("n_listed_extended", "extended sources of the input list inside the region, found or not"),
    number("n_listed_extended_called", "of these, matched to a detection called extended"),
    *fraction("listed_called", "n_listed_extended_called / n_listed_extended"),
    value("auc", "chance that an extended detection looks more extended than a point; NaN without both"),
    value("auc_lower_fields", "lower end of auc from resampled fields (68.27 %)"),
    value("auc_upper_fields", "upper end of auc from resampled fields (68.27 %)"),
    value("median_point", "median statistic of the points, in its unit"),
    value("median_extended", "median statistic of the extended detections, in its unit"),
))  # fmt: skip

CLASSIFICATION_CURVE = Table("classification_curve", "Contamination against completeness when the cut is moved", (
    *IDENTITY,
    *_STATISTIC,
    value("threshold", "cut, in the unit of the statistic; infinite where it takes in all, NaN with the unmeasured"),
    number("n_extended_called", "extended detections called extended"),
    number("n_other_called", "points, blends and spurious detections called extended"),
    value("completeness", "n_extended_called over all extended detections"),
    value("completeness_lower", "lower end (Jeffreys, 68.27 %)"),
    value("completeness_upper", "upper end (Jeffreys, 68.27 %)"),
    value("contamination", "n_other_called over all called extended"),
    value("contamination_lower", "lower end (Jeffreys, 68.27 %)"),
    value("contamination_upper", "upper end (Jeffreys, 68.27 %)"),
    *(
        value(f"{name}_{end}_fields", f"{end} end of {name} from resampled fields; NaN for a single field")
        for name in ("completeness", "contamination")
        for end in ("lower", "upper")
    ),
))  # fmt: skip

CHANCE_MATCHES = Table("chance_matches", "Chance matches: detections turned about the optical axis (nearest rule)", (
    *IDENTITY,
    Column("catalogue", "string", "detections turned: all, or the unmatched ones, which alone can take a lost source"),
    Column("of", "string", "detections: those with a listed source in the radius; sources: those claimed by one"),
    number("n_fields_turned", "fields turned, the first ones of the run"),
    number("n_rotations", "turns of each field"),
    value("radius_arcsec", "search radius", "arcsec", "pos.angDistance"),
    number("n_found", "matched by chance, summed over turns"),
    number("n_tried", "tried, summed over turns"),
    *fraction("chance", "n_found / n_tried"),
    value("density_per_deg2", "listed sources (of detections) or detections (of sources) in the region", "1 / deg2"),
    value("closed_form", "1 − exp(−π radius² density), for unclustered ones"),
))  # fmt: skip
