"""Compare the detections of one procedure with the truth of one field.

Idea     photons in apertures and pairs within a radius are found once; both rules then read them.
Limits   see `nearest` and `origin` for what each rule cannot see.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from survey_mc.array_frame import ArrayFrame
from survey_mc.match.apertures import aperture_radius_arcsec, photon_shares
from survey_mc.match.catalogue import detections_of, sources_of
from survey_mc.match.links import close_pairs, link_rows, separation_arcsec
from survey_mc.match.nearest import by_position
from survey_mc.match.origin import by_origin, find_origins
from survey_mc.match.outcome import in_scope, match_rows
from survey_mc.match.params import MatchParams
from survey_mc.types import Field

if TYPE_CHECKING:
    from pandas import DataFrame


@dataclass(frozen=True, slots=True)
class Matched:
    """match_rows, link_rows: `columns.MATCHES` and `columns.LINKS` without `realisation`."""

    match_rows: ArrayFrame
    link_rows: ArrayFrame

    @property
    def matches(self) -> DataFrame:
        """The matches as a new frame, to look at."""
        return self.match_rows.frame()

    @property
    def links(self) -> DataFrame:
        """The links as a new frame, to look at."""
        return self.link_rows.frame()


def match_field(field: Field, detections: DataFrame | ArrayFrame, params: MatchParams, counts_min: float) -> Matched:
    """Match detections with the sources of a field by both rules, over the whole image, then decide the scope.

    detections: `columns.DETECTIONS` without `realisation`, unique det_id, zero rows allowed; a frame in any order, rows
    in that of det_id.
    counts_min: count limit of the input list (`MatchParams.limit`). The rows do not depend on `params.rule`.
    """
    if not isinstance(detections, ArrayFrame):
        detections = ArrayFrame.of_frame(detections.sort_values("det_id"))
    scale_arcsec = field.observation.grid.scale_arcsec
    sources = sources_of(field.truth_rows, params, counts_min)
    found = detections_of(detections, params)
    radius_arcsec = aperture_radius_arcsec(found.r50_arcsec, params)
    shares = photon_shares(field, found.x_pix, found.y_pix, radius_arcsec)
    origins = find_origins(shares, found, sources, params, scale_arcsec)
    close = close_pairs(found, sources, params.link_radius_arcsec, scale_arcsec)

    candidates = close.where(close.sep_arcsec <= params.radius_arcsec)
    verdicts = {
        "nearest": by_position(candidates, sources, origins, params.assignment),
        "origin": by_origin(origins, sources),
    }
    every = np.arange(len(found.det_id))
    separations = {
        rule: separation_arcsec(found, sources, every, verdict.source, scale_arcsec)
        for rule, verdict in verdicts.items()
    }
    joins = {rule: in_scope(verdict, found, sources) for rule, verdict in verdicts.items()}
    return Matched(
        match_rows(joins, origins, separations, field.truth_rows, detections),
        link_rows(found, sources, close, shares, params.origin_counts_min, scale_arcsec),
    )
