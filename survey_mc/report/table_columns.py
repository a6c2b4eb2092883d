"""Every column of the aggregated tables: name, type, unit, meaning.

Idea     the same declarations write the Parquet metadata, the CSV header and the documentation.
"""

from __future__ import annotations

from survey_mc.columns import Column, Table

FLUX = "erg / (s cm2)"

CELL = Column("cell", "string", "combination of the campaign's grid", ucd="meta.id")
BAND = Column("band", "string", "energy band", ucd="instr.bandpass")
EXPOSURE = Column("exposure_ks", "float64", "exposure on axis", "ks", "time.duration;obs.exposure")
METHOD = Column("method", "string", "label of the method in the campaign", ucd="meta.id")
RULE = Column("rule", "string", "matching rule: nearest (position) or origin (photons)")
N_FIELDS = Column("n_fields", "int64", "fields summed", ucd="meta.number")
KIND = Column("kind", "string", "true sources: all; point and extended besides, where a cell has both", ucd="src.class")
IDENTITY = (CELL, BAND, EXPOSURE, METHOD, RULE, N_FIELDS)


def _number(name: str, about: str) -> Column:
    return Column(name, "int64", about, ucd="meta.number")


def _value(name: str, about: str, unit: str = "", ucd: str = "") -> Column:
    return Column(name, "float64", about, unit, ucd)


def _rate(name: str, about: str, unit: str) -> tuple[Column, ...]:
    """A value and its exact Poisson interval."""
    return (
        _value(name, about, unit),
        _value(f"{name}_lower", f"lower end of {name} (Garwood, 68.27 %)", unit),
        _value(f"{name}_upper", f"upper end of {name} (Garwood, 68.27 %)", unit),
    )


QUANTITY = Column("quantity", "string", "input quantity binned: flux_true_cgs or counts_expected (see its unit there)")

COMPLETENESS = Table("completeness", "Found over true sources in bins of an input quantity", (
    *IDENTITY,
    KIND,
    QUANTITY,
    _value("lower_edge", "lower edge of the bin, in the unit of the quantity"),
    _value("upper_edge", "upper edge of the bin, in the unit of the quantity"),
    _value("centre", "geometric mean of the true sources in the bin, in the unit of the quantity"),
    _number("n_true", "sources of the input list inside the region"),
    _number("n_found", "of these, matched"),
    _value("completeness", "n_found / n_true"),
    _value("lower", "lower end (Jeffreys, 68.27 %)"),
    _value("upper", "upper end (Jeffreys, 68.27 %)"),
    _value("lower_fields", "lower end from resampled fields; NaN for a single field"),
    _value("upper_fields", "upper end from resampled fields; NaN for a single field"),
    _value("design_effect", "variance between fields over the binomial one; above 1.3 Jeffreys is too short"),
))  # fmt: skip

COMPLETENESS_LIMIT = Table("completeness_limit", "Where the completeness reaches a level", (
    *IDENTITY,
    KIND,
    QUANTITY,
    _value("level", "completeness asked for"),
    _value("limit", "flux or counts at which it is reached (isotonic regression, linear in the logarithm); NaN if not"),
    _value("lower", "lower end from resampled fields (68.27 %); 0 if open, NaN for a single field"),
    _value("upper", "upper end from resampled fields (68.27 %); inf if open, NaN for a single field"),
    Column("state", "string", "reached, not reached or below range"),
))  # fmt: skip

_DENSITIES = (
    _number("n_input", "true sources inside the region, however faint"),
    *_rate("input_per_deg2", "density of the true sources", "1 / deg2"),
    _number("n_detected", "detections inside the region, not cross-identified"),
    *_rate("detected_per_deg2", "density of the detections", "1 / deg2"),
    _number("n_false", "false detections inside the region: faint, blend and spurious"),
    *_rate("false_per_deg2", "density of the false detections", "1 / deg2"),
)

COUNTS_DIFFERENTIAL = Table("counts_differential", "Numbers in flux bins: true flux for the input, else measured", (
    *IDENTITY,
    _value("flux_min_cgs", "lower edge of the bin", FLUX, "phot.flux;em.X-ray;stat.min"),
    _value("flux_max_cgs", "upper edge of the bin", FLUX, "phot.flux;em.X-ray;stat.max"),
    *_DENSITIES,
))  # fmt: skip

COUNTS_INTEGRAL = Table("counts_integral", "Numbers at and above a flux: true flux for the input, else measured", (
    *IDENTITY,
    _value("flux_min_cgs", "counted from this flux on", FLUX, "phot.flux;em.X-ray;stat.min"),
    *_DENSITIES,
))  # fmt: skip

FALSE_DETECTIONS = Table("false_detections", "Detections inside the region by outcome, and rates of the false ones", (
    *IDENTITY,
    _number("n_detections", "detections in scope"),
    _number("n_matched", "with a source of the input list as theirs"),
    _number("n_duplicate", "on a source that another detection has"),
    _number("n_faint", "on a source below the count limit"),
    _number("n_blend", "resting on two or more sources, none of them theirs"),
    _number("n_spurious", "resting on nothing"),
    _number("n_false", "without a listed counterpart: faint, blend and spurious"),
    *_rate("false_per_field", "false detections of a field", ""),
    *_rate("false_per_deg2", "false detections of a square degree", "1 / deg2"),
    *_rate("spurious_per_field", "spurious detections of a field", ""),
    *_rate("spurious_per_deg2", "spurious detections of a square degree", "1 / deg2"),
    _value("purity", "n_matched / n_detections"),
    _value("purity_lower", "lower end (Jeffreys, 68.27 %)"),
    _value("purity_upper", "upper end (Jeffreys, 68.27 %)"),
))  # fmt: skip

STATUS_COUNTS = Table("status_counts", "Rows of the matches by status and kind of the source", (
    *IDENTITY,
    Column("status", "string", "matched, duplicate, faint, blend, spurious, outside or missed"),
    Column("kind", "string", "kind of the source (point, extended, image) or all"),
    _number("n", "rows"),
    _value("per_field", "rows of a field"),
    _value("lower", "lower end of per_field (Garwood, 68.27 %)"),
    _value("upper", "upper end of per_field (Garwood, 68.27 %)"),
))  # fmt: skip

_PART = (
    Column("selection", "string", "flux bin, counts bin (of counts_onaxis) or a named subset of the matched sources"),
    _value("lower_edge", "lower edge of the bin (flux in erg/s/cm2, or counts); NaN for named subsets"),
    _value("upper_edge", "upper edge of the bin (flux in erg/s/cm2, or counts); NaN for named subsets"),
    _number("n", "matched sources"),
)

PHOTOMETRY = Table("photometry", "Measured over true counts and fluxes of matched sources", (
    *IDENTITY,
    KIND,
    Column("ratio", "string", "counts / counts_onaxis, counts / counts_expected or flux / flux_true"),
    *_PART,
    _value("median", "median ratio"),
    _value("median_lower", "lower end of the median (binomial rank, 68.27 %)"),
    _value("median_upper", "upper end of the median (binomial rank, 68.27 %)"),
    _value("q16", "16 % of the sources are below"),
    _value("q84", "84 % of the sources are below"),
    _value("mean", "mean ratio (the paper's)"),
    _value("mean_err", "standard error of the mean"),
    _value("stdev", "standard deviation (the paper's)"),
))  # fmt: skip

ASTROMETRY = Table("astrometry", "Separations between detections and their sources", (
    *IDENTITY,
    KIND,
    *_PART,
    *(_value(f"{name}_arcsec", about, "arcsec", "pos.angDistance") for name, about in (
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
    _number("fields", "fields worked on"),
    _value("cpu_s", "processor seconds, summed", "s"),
    _value("wall_s", "elapsed seconds, summed", "s"),
    _value("cpu_s_per_field", "cpu_s / fields", "s"),
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
)
