"""Every column of the aggregated tables: name, type, unit, meaning.

Idea     the same declarations write the Parquet metadata, the CSV header and the documentation.
"""

from __future__ import annotations

from survey_mc.columns import Column, Table
from survey_mc.report.classification_columns import CHANCE_MATCHES, CLASSIFICATION, CLASSIFICATION_CURVE
from survey_mc.report.common_columns import CELL, FLUX, IDENTITY, KIND, fraction, number, rate, value

QUANTITY = Column("quantity", "string", "input quantity binned: flux_true_cgs or counts_expected (see its unit there)")

COMPLETENESS = Table("completeness", "Found over true sources in bins of an input quantity", (
    *IDENTITY,
    KIND,
    QUANTITY,
    value("lower_edge", "lower edge of the bin, in the unit of the quantity"),
    value("upper_edge", "upper edge of the bin, in the unit of the quantity"),
    value("centre", "geometric mean of the true sources in the bin, in the unit of the quantity"),
    number("n_true", "sources of the input list inside the region"),
    number("n_found", "of these, matched"),
    value("completeness", "n_found / n_true"),
    value("lower", "lower end (Jeffreys, 68.27 %)"),
    value("upper", "upper end (Jeffreys, 68.27 %)"),
    value("lower_fields", "lower end from resampled fields; NaN for a single field"),
    value("upper_fields", "upper end from resampled fields; NaN for a single field"),
    value("lower_cp", "lower end for claims, at least … complete (Clopper–Pearson, 95 %)"),
    value("upper_cp", "upper end for claims (Clopper–Pearson, 95 %)"),
    value("design_effect", "variance between fields over the binomial one; above 1.3 Jeffreys is too short"),
    value(
        "completeness_corrected",
        "without chance matches, (C − p)/(1 − p), p of lost sources in chance_matches; NaN for the origin rule",
    ),
))  # fmt: skip

COMPLETENESS_LIMIT = Table("completeness_limit", "Where the completeness reaches a level", (
    *IDENTITY,
    KIND,
    QUANTITY,
    value("level", "completeness asked for"),
    value("limit", "flux or counts at which it is reached (isotonic regression, linear in the logarithm); NaN if not"),
    value("lower", "lower end from resampled fields (68.27 %); 0 if open, NaN for a single field"),
    value("upper", "upper end from resampled fields (68.27 %); inf if open, NaN for a single field"),
    Column("state", "string", "reached, not reached or below range"),
))  # fmt: skip

_DENSITIES = (
    number("n_input", "true sources inside the region, however faint"),
    *rate("input_per_deg2", "density of the true sources", "1 / deg2"),
    number("n_detected", "detections inside the region, not cross-identified"),
    *rate("detected_per_deg2", "density of the detections", "1 / deg2"),
    number("n_false", "false detections inside the region: faint, blend and spurious"),
    *rate("false_per_deg2", "density of the false detections", "1 / deg2"),
)

COUNTS_DIFFERENTIAL = Table("counts_differential", "Numbers in flux bins: true flux for the input, else measured", (
    *IDENTITY,
    value("flux_min_cgs", "lower edge of the bin", FLUX, "phot.flux;em.X-ray;stat.min"),
    value("flux_max_cgs", "upper edge of the bin", FLUX, "phot.flux;em.X-ray;stat.max"),
    *_DENSITIES,
))  # fmt: skip

COUNTS_INTEGRAL = Table("counts_integral", "Numbers at and above a flux: true flux for the input, else measured", (
    *IDENTITY,
    value("flux_min_cgs", "counted from this flux on", FLUX, "phot.flux;em.X-ray;stat.min"),
    *_DENSITIES,
))  # fmt: skip

FALSE_DETECTIONS = Table("false_detections", "Detections inside the region by outcome, and rates of the false ones", (
    *IDENTITY,
    number("n_detections", "detections in scope"),
    number("n_matched", "with a source of the input list as theirs"),
    number("n_duplicate", "on a source that another detection has"),
    number("n_faint", "on a source below the count limit"),
    number("n_blend", "resting on two or more sources, none of them theirs"),
    number("n_spurious", "resting on nothing"),
    number("n_false", "the paper's false ones, without a listed counterpart: faint, blend and spurious"),
    *(
        column
        for name in ("false", "spurious", "blend", "faint", "duplicate")
        for column in (
            *rate(f"{name}_per_field", f"n_{name} of a field", ""),
            *rate(f"{name}_per_deg2", f"n_{name} of a square degree", "1 / deg2"),
        )
    ),
    *fraction("purity", "n_matched / n_detections"),
))  # fmt: skip

STATUS_COUNTS = Table("status_counts", "Rows of the matches by status and kind of the source", (
    *IDENTITY,
    Column("status", "string", "matched, duplicate, faint, blend, spurious, outside or missed"),
    Column("kind", "string", "kind of the source (point, extended, image) or all"),
    number("n", "rows"),
    value("per_field", "rows of a field"),
    value("lower", "lower end of per_field (Garwood, 68.27 %)"),
    value("upper", "upper end of per_field (Garwood, 68.27 %)"),
    *rate("per_deg2", "rows of a square degree of the region", "1 / deg2"),
))  # fmt: skip

_PART = (
    Column("selection", "string", "flux bin, counts bin (of counts_onaxis) or a named subset of the matched sources"),
    value("lower_edge", "lower edge of the bin (flux in erg/s/cm2, or counts); NaN for named subsets"),
    value("upper_edge", "upper edge of the bin (flux in erg/s/cm2, or counts); NaN for named subsets"),
    number("n", "matched sources"),
)

PHOTOMETRY = Table("photometry", "Measured over true counts and fluxes of matched sources", (
    *IDENTITY,
    KIND,
    Column(
        "ratio", "string", "counts / counts_onaxis (un-vignetted: the paper's), counts / counts_expected or "
        "flux / flux_true"
    ),
    *_PART,
    value("median", "median ratio"),
    value("median_lower", "lower end of the median (binomial rank, 68.27 %)"),
    value("median_upper", "upper end of the median (binomial rank, 68.27 %)"),
    *(
        column
        for name, about in (("q16", "16 %"), ("q84", "84 %"))
        for column in (
            value(name, f"{about} of the sources are below"),
            value(f"{name}_lower", f"lower end of {name} (binomial rank, 68.27 %)"),
            value(f"{name}_upper", f"upper end of {name} (binomial rank, 68.27 %)"),
        )
    ),
    value("mean", "mean ratio (the paper's)"),
    value("mean_err", "standard error of the mean"),
    value("stdev", "standard deviation (the paper's)"),
))  # fmt: skip

ASTROMETRY = Table("astrometry", "Separations between detections and their sources", (
    *IDENTITY,
    KIND,
    *_PART,
    *(value(f"{name}_arcsec", about, "arcsec", "pos.angDistance") for name, about in (
        ("median", "median separation"),
        ("median_lower", "lower end of the median (68.27 %)"),
        ("median_upper", "upper end of the median (68.27 %)"),
        ("one_sigma", "radius with 68.27 % of the separations"),
        ("one_sigma_lower", "lower end of one_sigma (68.27 %)"),
        ("one_sigma_upper", "upper end of one_sigma (68.27 %)"),
        ("mean", "mean separation"),
        ("mean_err", "standard error of the mean"),
        ("rms", "root mean square separation"),
    )),
))  # fmt: skip

CPU_SECONDS = Table("cpu_seconds", "What the work cost; not reproducible", (
    CELL,
    Column("method", "string", "label of the method; empty for drawing the fields and storing the truth"),
    Column("stage", "string", "draw, detect, match or commit"),
    number("fields", "fields worked on"),
    value("cpu_s", "processor seconds, summed", "s"),
    value("wall_s", "elapsed seconds, summed", "s"),
    value("cpu_s_per_field", "cpu_s / fields", "s"),
))  # fmt: skip

# Everything that equal runs make equal; the costs are kept apart.
TABLES = (
    COMPLETENESS,
    COMPLETENESS_LIMIT,
    COUNTS_DIFFERENTIAL,
    COUNTS_INTEGRAL,
    FALSE_DETECTIONS,
    STATUS_COUNTS,
    PHOTOMETRY,
    ASTROMETRY,
    CLASSIFICATION,
    CLASSIFICATION_CURVE,
    CHANCE_MATCHES,
)
REPORT_TABLES = (*TABLES, CPU_SECONDS)
