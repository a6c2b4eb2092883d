"""Parameters and own columns of VTPDETECT.

Source   names, ranges and defaults of the CIAO 4 help page of `vtpdetect` (maxiter, maxbkgflux, … with underscores).
"""

from __future__ import annotations

from typing import Literal, Self

from pydantic import Field, model_validator

from survey_mc.columns import Column
from survey_mc.detect.detector import DetectorParams

VTP_COLUMNS = (
    Column(
        "BKG_COUNTS",
        "float64",
        "background counts expected in the group's cells",
        "count",
        "phot.count;instr.background",
    ),
    Column("NPIXSOU", "float64", "area of the group's cells", "pixel2", "phys.angArea"),
    Column("N_CELLS", "int32", "number of cells (distinct photon positions) of the group", ucd="meta.number"),
    Column(
        "R_1",
        "float64",
        "longer semi-axis of the ellipse: ell_sigma × the photons' rms",
        "pixel",
        "phys.angSize.smajAxis",
    ),
    Column("R_2", "float64", "shorter semi-axis of the ellipse", "pixel", "phys.angSize.sminAxis"),
    Column("ROTANG", "float64", "angle of the longer axis, from x towards y, 0 … 180", "deg", "pos.posAng"),
    Column(
        "CUTOFF", "float64", "cell flux above which cells were joined, in units of the background", ucd="arith.ratio"
    ),
)  # fmt: skip


class VtpDetectParams(DetectorParams):
    """Parameters of VTPDETECT; the defaults are those of CIAO, with the exposure map."""

    positions: Literal["pixel", "jitter", "photons"] = Field(
        "pixel",
        description="photons in the centre of their pixel with their multiplicity (CIAO, images), thrown uniformly "
        "into their pixel, or the unbinned photon list of the observation",
    )
    background: Literal["fit", "granted"] = Field(
        "fit", description="level fitted to the faint cells, or the map the campaign grants"
    )
    use_exposure: bool = Field(
        True,
        description="divide the cell fluxes by the exposure, so that the background follows it (CIAO: expfile); "
        "without it a vignetted field is one large source",
    )
    voronoi_k: float = Field(
        4.0, ge=2.0, le=10.0, description="index of the Γ law of cell areas: 4 (Kiang 1966) or 3.5 (Járai-Szabó & Néda)"
    )
    scale: float = Field(1.0, gt=0.0, le=100.0, description="factor on the flux cut-off")
    limit: float = Field(
        1e-6, gt=0.0, le=0.5, description="tolerated probability that the background makes a group's counts"
    )
    tested_counts: Literal["net", "total"] = Field(
        "total",
        description="counts that must reach the smallest number the background exceeds with probability limit: all, or "
        "less the expected background; CIAO's help page can be read both ways",
    )
    coarse: int = Field(10, ge=1, le=100_000, description="smallest number of photons of a source (photons)")
    max_iter: int = Field(10, ge=1, le=100, description="most iterations of background, cut-off and groups")
    edge_pix: int = Field(
        2, ge=0, le=1000, description="cells this near to the border or an unobserved pixel are left out (pixels)"
    )
    max_bkg_flux: float = Field(
        0.8, gt=0.0, le=10.0, description="cells up to this flux give the background (units of the background)"
    )
    min_tot_flux: float = Field(
        0.8, gt=0.0, le=100.0, description="the cut-off is searched from this flux (units of the background)"
    )
    max_tot_flux: float = Field(2.6, gt=0.0, le=100.0, description="… to this flux (units of the background)")
    min_cutoff: float = Field(
        1.2, gt=0.0, le=1e3, description="the cut-off, before scale, is at least this (units of the background)"
    )
    max_cutoff: float = Field(
        3.0, gt=0.0, le=1e3, description="the cut-off, before scale, is at most this (units of the background)"
    )
    fit_tolerance: float = Field(
        1e-6, ge=1e-12, le=0.1, description="tolerance of the background fit (relative, of the level)"
    )
    fit_start: float = Field(
        1.5,
        ge=0.9,
        le=2.0,
        description="largest background level the fit tries (units of the background)",
    )
    centroid: Literal["counts", "flux"] = Field(
        "counts", description="weight of the cells in position and ellipse: their net counts, or their flux"
    )
    ell_sigma: float = Field(3.0, gt=0.0, le=100.0, description="size of the ellipse (σ of the photons)")

    @model_validator(mode="after")
    def _ranges_ascend(self) -> Self:
        for low, high in (("min_tot_flux", "max_tot_flux"), ("min_cutoff", "max_cutoff")):
            if getattr(self, low) >= getattr(self, high):
                raise ValueError(f"{low} must be below {high} (got {getattr(self, low)}, {getattr(self, high)})")
        return self
