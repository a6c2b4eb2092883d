"""Every column of every stored table: name, dtype, unit, UCD, meaning.

Idea     declared once; code, Parquet schemas, FITS headers, documentation and tests read it from here.
Source   UCD1+ vocabulary of the IVOA; names follow `definitions` of the README (counts_onaxis, counts_expected, …).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

DType = Literal["int32", "int64", "float64", "bool", "string"]


@dataclass(frozen=True, slots=True)
class Column:
    name: str
    dtype: DType
    about: str
    unit: str = ""
    ucd: str = ""


@dataclass(frozen=True, slots=True)
class Table:
    """A table schema: ordered columns with unique names. `version` is raised when a meaning changes."""

    name: str
    about: str
    columns: tuple[Column, ...]
    version: int = 1

    @property
    def names(self) -> tuple[str, ...]:
        return tuple(c.name for c in self.columns)

    def with_columns(self, extra: tuple[Column, ...]) -> Table:
        """The same table followed by a method's own columns."""
        return Table(self.name, self.about, self.columns + extra, self.version)


REALISATION = Column("realisation", "int32", "number of the random realisation, from 0")
SOURCE_ID = Column("source_id", "int32", "number of the true source in its field; -1: none", ucd="meta.id")
DET_ID = Column("det_id", "int32", "number of the detection in its field and method; -1: none", ucd="meta.id")

COUNTS_ONAXIS = Column(
    "counts_onaxis", "float64", "rate × exposure, un-vignetted (the paper's input counts)", "count", "phot.count"
)
COUNTS_EXPECTED = Column(
    "counts_expected",
    "float64",
    "expected counts: counts_onaxis × vignetting, inside the field of view, all of the PSF",
    "count",
    "phot.count",
)
COUNTS_DRAWN = Column("counts_drawn", "int32", "photons of the source that fell on the image", "count", "phot.count")

TRUTH = Table("truth", "True sources of each field", (
    REALISATION,
    SOURCE_ID,
    Column("kind", "string", "point, extended (β-model) or image (a folded sky image)", ucd="src.class"),
    Column("x_arcsec", "float64", "offset from the optical axis, along x", "arcsec", "pos.cartesian.x"),
    Column("y_arcsec", "float64", "offset from the optical axis, along y", "arcsec", "pos.cartesian.y"),
    Column("x_pix", "float64", "position, first pixel centre at 0", "pixel", "pos.cartesian.x;instr.det"),
    Column("y_pix", "float64", "position, first pixel centre at 0", "pixel", "pos.cartesian.y;instr.det"),
    Column("offaxis_arcmin", "float64", "angle to the optical axis", "arcmin", "pos.angDistance"),
    Column("flux_cgs", "float64", "flux in the band", "erg / (s cm2)", "phot.flux;em.X-ray"),
    Column("rate_cps", "float64", "on-axis count rate in the band", "ct / s", "phot.count;arith.rate"),
    Column("core_radius_arcsec", "float64", "core radius of the β-model; NaN for a point", "arcsec", "phys.angSize"),
    Column("beta", "float64", "β of the β-model; NaN for a point"),
    Column("redshift", "float64", "redshift of a cluster; NaN if none", ucd="src.redshift"),
    Column("group_id", "int32", "pair or grid group of a designed layout; -1: none"),
    Column("group_sep_arcsec", "float64", "designed separation inside the group; NaN if none", "arcsec", "pos.angDistance"),
    COUNTS_ONAXIS,
    COUNTS_EXPECTED,
    COUNTS_DRAWN,
))  # fmt: skip

DETECTIONS = Table("detections", "What a procedure found; every procedure shares these columns", (
    REALISATION,
    DET_ID,
    Column("x_pix", "float64", "position, first pixel centre at 0", "pixel", "pos.cartesian.x;instr.det"),
    Column("y_pix", "float64", "position, first pixel centre at 0", "pixel", "pos.cartesian.y;instr.det"),
    Column("x_err_pix", "float64", "1σ error of x_pix; NaN if the procedure gives none", "pixel", "stat.error;pos.cartesian.x"),
    Column("y_err_pix", "float64", "1σ error of y_pix; NaN if the procedure gives none", "pixel", "stat.error;pos.cartesian.y"),
    Column("offaxis_arcmin", "float64", "angle to the optical axis", "arcmin", "pos.angDistance"),
    Column("counts", "float64", "source counts measured by the procedure", "count", "phot.count;em.X-ray"),
    Column("counts_err", "float64", "1σ error of counts", "count", "stat.error;phot.count"),
    Column("exposure_s", "float64", "exposure × vignetting at the position", "s", "time.duration;obs.exposure"),
    Column("rate_cps", "float64", "counts / exposure_s: vignetting-corrected on-axis rate", "ct / s", "phot.count;arith.rate"),
    Column("flux_cgs", "float64", "flux of rate_cps; NaN without a conversion factor", "erg / (s cm2)", "phot.flux;em.X-ray"),
    Column("flux_err_cgs", "float64", "1σ error of flux_cgs", "erg / (s cm2)", "stat.error;phot.flux"),
    Column("background_per_pix", "float64", "background the procedure used, counts per pixel", "count", "instr.background"),
    Column("significance", "float64", "the procedure's own ranking statistic, larger is surer", ucd="stat.snr"),
    Column("r50_arcsec", "float64", "radius with half of the measured counts; NaN if none", "arcsec", "phys.angSize;src"),
    Column("flags", "int32", "bit mask of warnings, see the method", ucd="meta.code.qual"),
))  # fmt: skip

MATCHES = Table("matches", "Full outer join of sources in scope and detections, for every matching rule", (
    REALISATION,
    Column("rule", "string", "nearest (the paper's) or origin (photons)"),
    Column("status", "string", "matched, duplicate, faint, blend, spurious, outside (detection beyond the region) or missed"),
    SOURCE_ID,
    DET_ID,
    Column("sep_arcsec", "float64", "detection to its source; NaN if none", "arcsec", "pos.angDistance"),
    Column("n_main", "int32", "photons in the detection's aperture from the main source, the one it rests on", "count", "phot.count"),
    Column("n_second", "int32", "photons in the aperture from the second source, the largest of the others", "count", "phot.count"),
    Column("n_background", "int32", "background photons in the aperture", "count", "phot.count"),
    Column("main_source_id", "int32", "source the detection rests on: largest photon excess over a ring around; -1: none", ucd="meta.id"),
    Column("second_source_id", "int32", "source that gives most of the other photons; -1: none", ucd="meta.id"),
    Column("is_blend", "bool", "the main source is significant and the second gives at least the blend fraction of its photons"),
    Column("kind_true", "string", "kind of the source; empty if none", ucd="src.class"),
    Column("flux_true_cgs", "float64", "flux of the source; NaN if none", "erg / (s cm2)", "phot.flux;em.X-ray"),
    COUNTS_ONAXIS,
    COUNTS_EXPECTED,
    COUNTS_DRAWN,
    Column("offaxis_true_arcmin", "float64", "off-axis angle of the source; NaN if none", "arcmin", "pos.angDistance"),
    Column("counts", "float64", "measured counts; NaN if missed", "count", "phot.count;em.X-ray"),
    Column("counts_err", "float64", "1σ error of counts", "count", "stat.error;phot.count"),
    Column("flux_cgs", "float64", "measured flux; NaN if missed", "erg / (s cm2)", "phot.flux;em.X-ray"),
    Column("offaxis_arcmin", "float64", "off-axis angle of the detection; NaN if missed", "arcmin", "pos.angDistance"),
    Column("significance", "float64", "the procedure's ranking statistic; NaN if missed", ucd="stat.snr"),
    Column("r50_arcsec", "float64", "measured half-light radius; NaN if missed", "arcsec", "phys.angSize;src"),
))  # fmt: skip

LINKS = Table("links", "All candidate pairs inside the link radius, and all pairs that share photons", (
    REALISATION,
    DET_ID,
    SOURCE_ID,
    Column("sep_arcsec", "float64", "detection to source", "arcsec", "pos.angDistance"),
    Column("n_photons", "int32", "photons of the source inside the detection's aperture", "count", "phot.count"),
    Column("in_list", "bool", "the source is above the count limit of the input list"),
))  # fmt: skip

# What a catalogue file adds to the detections: sky coordinates where the image has them, and FITS pixels.
RA = Column("RA", "float64", "right ascension, ICRS", "deg", "pos.eq.ra;meta.main")
DEC = Column("DEC", "float64", "declination, ICRS", "deg", "pos.eq.dec;meta.main")
RADEC_ERR = Column(
    "RADEC_ERR", "float64", "1σ position error, quadratic sum of both coordinates", "arcsec", "stat.error;pos.eq"
)
X_IMAGE = Column(
    "X_IMAGE", "float64", "FITS pixel position, first pixel centre at 1", "pixel", "pos.cartesian.x;instr.det"
)
Y_IMAGE = Column(
    "Y_IMAGE", "float64", "FITS pixel position, first pixel centre at 1", "pixel", "pos.cartesian.y;instr.det"
)
SKY_COLUMNS_OF_CATALOGUE = (RA, DEC, RADEC_ERR, X_IMAGE, Y_IMAGE)
