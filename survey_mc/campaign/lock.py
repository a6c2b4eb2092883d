"""The lock file of a run: every resolved parameter, every key, and the versions of what computed them."""

from __future__ import annotations

import hashlib
import platform
from functools import cache
from importlib.metadata import version
from typing import Any

from survey_mc import __version__
from survey_mc.campaign.cells import Cell, expand
from survey_mc.campaign.draw import cell_response
from survey_mc.campaign.schema import Campaign
from survey_mc.detect import DETECTORS
from survey_mc.lock_form import with_digest

_LIBRARIES = ("numpy", "scipy", "numba", "sep", "pandas", "pyarrow", "astropy", "dask", "distributed", "pydantic")


def library_versions() -> dict[str, str]:
    """Versions of everything that a result may depend on, packages with procedures of their own among them."""
    return _own_versions() | DETECTORS.packages


@cache
def _own_versions() -> dict[str, str]:
    return {
        "survey_mc": __version__,
        "python": platform.python_version(),
        "machine": platform.machine(),
        **{name: version(name) for name in _LIBRARIES},
    }


def lock_content(campaign: Campaign) -> dict[str, Any]:
    """Content of campaign.lock.json; `store.read_lock` reads it back.

    The campaign file is in it verbatim: of the two, each can be made again from the other. digest: SHA-256 of the rest.
    """
    content: dict[str, Any] = {
        "name": campaign.name,
        "about": campaign.about,
        "seed": campaign.seed,
        "campaign_sha256": hashlib.sha256(campaign.text.encode()).hexdigest(),
        "inputs_sha256": dict(campaign.input_digests),
        "versions": library_versions(),
        "methods": [
            {
                "name": m.name,
                "label": m.label,
                "version": DETECTORS[m.name].version,
                "reference": DETECTORS[m.name].reference,
                "package": DETECTORS.origin(m.name) or f"survey-mc {__version__}",
                "params": m.params.model_dump(mode="json"),
            }
            for m in campaign.method
        ],
        "cells": [_cell_entry(campaign, cell) for cell in expand(campaign)],
        "campaign": campaign.model_dump(mode="json", by_alias=True),
        "campaign_text": campaign.text,
    }
    return with_digest(content)


def _cell_entry(campaign: Campaign, cell: Cell) -> dict[str, Any]:
    response = cell_response(campaign, cell)
    return {
        "label": cell.label,
        "instrument": cell.instrument,
        "band": cell.band,
        "exposure_ks": cell.exposure_ks,
        "realisations": cell.realisations,
        "counts_min": cell.counts_min,
        "region_arcmin": campaign.match.region_arcmin,
        "region_deg2": response.observed_deg2(campaign.match.region_arcmin),
        "radius_arcsec": campaign.match.radius_arcsec,
        "rule": campaign.match.rule,
        "flux_per_rate_cgs": response.band.flux_per_rate_cgs,
        "field_key": cell.field_key,
        "detect_keys": {m.label: m.detect_key for m in cell.methods},
        "match_keys": {m.label: m.match_key for m in cell.methods},
    }
