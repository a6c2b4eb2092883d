"""A run made of plausible numbers, without images: what the report needs of `store.RunData`."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pandas as pd

from survey_mc.columns import MATCHES
from survey_mc.units import deg2_of_circle, rate_from_flux

AXIS_PIX, SCALE_ARCSEC = 255.5, 4.0
FLUX_PER_RATE_CGS = {"soft": 6.70e-13, "hard": 3.66e-12}


@dataclass(frozen=True)
class FakeCell:
    band: str
    exposure_ks: float
    realisations: int
    counts_min: float = 10.0
    instrument: str = "xmm_epic"
    region_arcmin: float = 10.0
    radius_arcsec: float = 6.0
    rule: str = "nearest"
    name: str = ""

    @property
    def region_deg2(self) -> float:
        return deg2_of_circle(self.region_arcmin)

    @property
    def label(self) -> str:
        return self.name or f"{self.instrument}-{self.band}-{self.exposure_ks:g}ks"


@dataclass(frozen=True)
class FakeMethod:
    name: str
    label: str
    counts_at_half: float = 18.0
    false_rate: float = 2.0


@dataclass
class FakeRun:
    cells: tuple[FakeCell, ...]
    methods: tuple[FakeMethod, ...]
    lock: dict[str, Any] = field(
        default_factory=lambda: {"name": "fake", "about": "numbers made up", "seed": 7, "versions": {"numpy": "2"}}
    )

    def frames(self, table, cell_label, method_label="", columns=None):
        cell = next(c for c in self.cells if c.label == cell_label)
        for realisation in range(cell.realisations):
            truth = _truth(cell, realisation)
            if table != "truth":
                method = next(m for m in self.methods if m.label == method_label)
                frame = _matches(cell, method, realisation, truth)
                frame = _detections(frame, truth) if table == "detections" else frame
            else:
                frame = truth
            yield frame if columns is None else frame[list(columns)]

    def realisations_done(self, table, cell_label, method_label=""):
        return next(c.realisations for c in self.cells if c.label == cell_label)

    def journal(self):
        rows = [
            {"cell": c.label, "method": m.label, "stage": stage, "fields": c.realisations,
             "cpu_s": 0.01 * (i + 1) ** 3 * c.realisations * (5 if stage == "detect" else 1),
             "wall_s": 0.1 * c.realisations}
            for c in self.cells for i, m in enumerate(self.methods) for stage in ("detect", "match")
        ]  # fmt: skip
        draw = {"method": "", "stage": "draw", "cpu_s": 0.02, "wall_s": 1.0}
        rows += [{"cell": c.label, "fields": c.realisations, **draw} for c in self.cells]
        return pd.DataFrame(rows, columns=["cell", "method", "stage", "fields", "cpu_s", "wall_s"])


def _truth(cell, realisation):
    rng = np.random.default_rng([realisation, int(cell.exposure_ks), len(cell.band)])
    n = rng.poisson(900)
    flux_cgs = 2e-16 * (1.0 - rng.random(n)) ** (-1 / 1.3)
    offaxis = 17.0 * np.sqrt(rng.random(n))
    counts = rate_from_flux(flux_cgs, FLUX_PER_RATE_CGS[cell.band]) * cell.exposure_ks * 1e3
    expected = counts * (1.0 - 0.0047 * offaxis**2 * 0.5)
    angle = 2.0 * np.pi * rng.random(n)
    x_arcsec, y_arcsec = 60.0 * offaxis * np.cos(angle), 60.0 * offaxis * np.sin(angle)
    return pd.DataFrame({"flux_cgs": flux_cgs, "offaxis_arcmin": offaxis, "counts_onaxis": counts,
                         "counts_expected": expected, "source_id": np.arange(n, dtype=np.int32),
                         "realisation": np.int32(realisation), "kind": "point", "x_arcsec": x_arcsec,
                         "y_arcsec": y_arcsec, "x_pix": AXIS_PIX + x_arcsec / SCALE_ARCSEC,
                         "y_pix": AXIS_PIX + y_arcsec / SCALE_ARCSEC})  # fmt: skip


def _detections(matches, truth):
    """The detections behind the rows of the first rule, at their sources; extents that grow with the source's id."""
    found = matches[(matches["rule"] == "nearest") & (matches["det_id"] >= 0)].reset_index(drop=True)
    known = truth.set_index("source_id").reindex(found["source_id"])
    axis_arcmin = found["offaxis_arcmin"].to_numpy()
    return found[["realisation", "det_id", "counts", "offaxis_arcmin"]].assign(
        x_pix=known["x_pix"].fillna(pd.Series(AXIS_PIX + 60.0 * axis_arcmin / SCALE_ARCSEC, known.index)).to_numpy(),
        y_pix=known["y_pix"].fillna(AXIS_PIX).to_numpy(),
        r50_arcsec=np.where(found["source_id"] % 7 == 0, 30.0, 10.0) + found["det_id"] % 5,
        EXT_ML=np.where(found["source_id"] % 7 == 0, 20.0, 0.0),
        stellarity=np.where(found["source_id"] % 7 == 0, 0.05, 0.9),
    )


def _matches(cell, method, realisation, truth):
    rng = np.random.default_rng([realisation, len(method.label), int(method.counts_at_half)])
    rows = []
    for rule in ("nearest", "origin"):
        listed = truth[(truth["counts_expected"] >= cell.counts_min) & (truth["offaxis_arcmin"] <= cell.region_arcmin)]
        logit = np.log(listed["counts_expected"] / (method.counts_at_half * np.sqrt(cell.exposure_ks / 10))) / 0.2
        found = rng.random(len(listed)) < 1 / (1 + np.exp(-logit))
        counts = rng.poisson(listed["counts_expected"]) * 0.95
        n = len(listed)
        columns = {
            "status": np.where(found, "matched", "missed"), "source_id": listed["source_id"].to_numpy(),
            "det_id": np.where(found, np.arange(n), -1), "kind_true": np.array(["point"] * n, dtype=object),
            "sep_arcsec": np.where(found, rng.rayleigh(6 / np.sqrt(listed["counts_expected"])), np.nan),
            "flux_true_cgs": listed["flux_cgs"].to_numpy(), "counts_onaxis": listed["counts_onaxis"].to_numpy(),
            "counts_expected": listed["counts_expected"].to_numpy(), "counts": np.where(found, counts, np.nan),
            "offaxis_arcmin": np.where(found, listed["offaxis_arcmin"], np.nan),
        }  # fmt: skip
        columns["flux_cgs"] = columns["flux_true_cgs"] * columns["counts"] / columns["counts_expected"]
        rows.append(pd.DataFrame(columns))
        n = rng.poisson(method.false_rate)
        rows.append(pd.DataFrame({
            "status": rng.choice(["spurious", "faint", "blend", "duplicate"], n, p=[0.5, 0.25, 0.15, 0.1]),
            "det_id": 500 + np.arange(n), "source_id": -1, "kind_true": "", "counts": 15.0,
            "flux_cgs": 10.0 ** rng.normal(-15.2, 0.2, n), "offaxis_arcmin": rng.uniform(0, 10, n),
        }))  # fmt: skip
        for frame in rows[-2:]:
            frame["rule"] = rule
    frame = pd.concat(rows, ignore_index=True).assign(realisation=realisation)
    return frame.reindex(columns=list(MATCHES.names)).fillna({"status": "spurious", "kind_true": ""})


def stub_writer(path, table, frame):
    """Stands in for the store's Parquet writer: exact values, no Parquet."""
    frame[list(table.names)].to_pickle(path)


CELLS = tuple(FakeCell(band, exposure, 6, 10.0 if exposure == 10.0 else 30.0)
              for band in ("soft", "hard") for exposure in (10.0, 100.0))  # fmt: skip
METHODS = (
    FakeMethod("emldetect", "EML", 14.0, 6.0),
    FakeMethod("mr1_se", "MR/1+SE", 18.0, 2.0),
    FakeMethod("gauss_se", "G+SE", 19.0, 4.0),
    FakeMethod("wavdetect", "WAV", 20.0, 9.0),
    FakeMethod("ewavelet", "EWAV", 19.0, 3.0),
    FakeMethod("vtpdetect", "VTP", 35.0, 15.0),
)
