"""Compare the detections of one procedure with the truth of one field.

Idea     photons in apertures and pairs within a radius are found once; both rules then read them.
Limits   see `nearest` and `origin` for what each rule cannot see.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from survey_mc.match.apertures import aperture_radius_arcsec, photon_shares
from survey_mc.match.catalogue import detections_of, sources_of
from survey_mc.match.links import close_pairs, link_frame, separation_arcsec
from survey_mc.match.nearest import by_position
from survey_mc.match.origin import by_origin, find_origins
from survey_mc.match.outcome import in_scope, match_frame
from survey_mc.match.params import MatchParams
from survey_mc.types import Field

if TYPE_CHECKING:
    from pandas import DataFrame


@dataclass(frozen=True, slots=True)
class Matched:
    """matches, links: `columns.MATCHES` and `columns.LINKS` without `realisation`."""

    matches: DataFrame
    links: DataFrame


def match_field(field: Field, detections: DataFrame, params: MatchParams, counts_min: float) -> Matched:
    """Match detections with the sources of a field by both rules, over the whole image, then decide the scope.

    detections: `columns.DETECTIONS` without `realisation`, unique det_id, any row order, zero rows allowed.
    counts_min: count limit of the input list (`MatchParams.limit`). The rows do not depend on `params.rule`.
    """
    if not detections["det_id"].is_monotonic_increasing:
        detections = detections.sort_values("det_id", ignore_index=True)
    scale_arcsec = field.observation.grid.scale_arcsec
    sources = sources_of(field.truth, params, counts_min)
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
    rows = {rule: in_scope(verdict, found, sources) for rule, verdict in verdicts.items()}
    return Matched(
        match_frame(rows, origins, separations, field.truth, detections),
        link_frame(found, sources, close, shares, params.origin_counts_min, scale_arcsec),
    )
