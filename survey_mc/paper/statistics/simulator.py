"""Constants of the simulation: what our code has, computed from its functions and not copied from its settings.

Idea     widths from the encircled energy and the surface brightness, background from photons drawn, core radii from
         the cosmology, counts from the conversions.
Source   paper Tabs. 1, 2 and 8, Sects. 2 and 8.
Limits   Tab. 2's count rates are inputs of our simulator too: agreement there says only that they were copied rightly.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import partial
from typing import Any, Literal

import numpy as np
from scipy.optimize import brentq

from survey_mc.paper.statistics.statistic import Alternative, Computed, Evidence, NotCompared
from survey_mc.rng import stream
from survey_mc.sky.clusters import TABLE_2, ClustersParams, core_radii_arcsec, count_rates
from survey_mc.sky.cosmology import SPEED_OF_LIGHT_KM_S
from survey_mc.telescope import INSTRUMENTS, InstrumentSettings
from survey_mc.telescope.psf import KingPsf
from survey_mc.telescope.vignetting import vignetting
from survey_mc.types import FloatArray
from survey_mc.units import SECONDS_PER_KS, rate_from_flux

N_DRAWN = 60  # blank images drawn for the background rate
EXPOSURE_S = 10.0 * SECONDS_PER_KS
LIMIT_FLUX_CGS, LIMIT_EXPOSURE_S = 6e-16, 100.0 * SECONDS_PER_KS  # paper Sect. 8
WIDEST_ARCSEC = 100.0
OFFAXIS_ARCMIN = 10.0

EPIC = INSTRUMENTS["xmm_epic"]
BANDS = {band.name: band for band in EPIC.bands}
_OTHER_CORE_RADII: tuple[tuple[str, str, dict[str, Any]], ...] = (
    ("speed of light = 300000 km/s", "the rounded speed of light in the distance", {"light_km_s": 300_000.0}),
    ("clusters.h_reading = text", "core radii of the text, twice those of Tab. 2", {"h_reading": "text"}),
)
RATE_BANDS = {"0.5_2": "soft", "2_10": "hard"}


def evidence() -> Iterator[Evidence]:
    """The claims sim.* and tab2.*."""
    yield Computed("sim.psf_fwhm", "twice the radius at which the PSF's surface brightness is half its peak", psf_fwhm)
    yield Computed("sim.psf_hew", "twice the radius that holds half of the PSF's photons", psf_hew)
    for name, band in BANDS.items():
        drawn = partial(background_drawn, name)
        yield Computed(f"sim.bkg_{name}", f"photons of {N_DRAWN} blank images over pixels and seconds", drawn)
        yield _constant(f"sim.vig_{name}", "vignetting at 10′", partial(_vignetting, band.vignetting))
        factor = float(band.flux_per_rate_cgs or np.nan)
        yield _constant(f"sim.ecf_{name}", "flux of one count per second", partial(float, factor))
    yield _constant("sim.counts_at_limit", "counts of 6e-16 erg/cm²/s in 100 ks on axis", counts_at_limit)
    for redshift in TABLE_2[:, 0]:
        yield from _cluster(float(redshift))


def _cluster(redshift: float) -> Iterator[Evidence]:
    name = f"tab2.z{redshift:.1f}"
    alternatives = tuple(
        Alternative(option, about, partial(other_core_radius, redshift, **changes))
        for option, about, changes in _OTHER_CORE_RADII
    )
    about = "angle of 250 kpc in the paper's cosmology"
    yield Computed(f"{name}.core_radius", about, partial(other_core_radius, redshift), alternatives)
    yield NotCompared(f"{name}.rate_0.4_4", "no band of the simulations: a conversion of the 0.5–2 keV rate")
    for band, ours in RATE_BANDS.items():
        yield _constant(f"{name}.rate_{band}", "count rate of our cluster", partial(cluster_rate, redshift, ours))


def _constant(claim: str, about: str, value: Callable[[], float]) -> Computed:
    return Computed(claim, about, lambda: np.array([value()]))


def _psf() -> KingPsf:
    return KingPsf.from_fwhm_hew(EPIC.psf_fwhm_arcsec, EPIC.psf_hew_arcsec)


def psf_fwhm() -> FloatArray:
    """(1,) arcsec, from the surface brightness."""
    psf = _psf()
    half = 0.5 * float(psf.surface_brightness(np.array(0.0)))
    radius = brentq(lambda r: float(psf.surface_brightness(np.array(r))) - half, 0.0, WIDEST_ARCSEC)
    return np.array([2.0 * radius])


def psf_hew() -> FloatArray:
    """(1,) arcsec, from the encircled energy."""
    psf = _psf()
    radius = brentq(lambda r: float(psf.encircled_energy(np.array(r))) - 0.5, 0.0, WIDEST_ARCSEC)
    return np.array([2.0 * radius])


def background_drawn(band: str) -> FloatArray:
    """(N_DRAWN,) photons per second and pixel of blank images without vignetting."""
    from survey_mc.sky import SkyContext, draw_sky
    from survey_mc.sky.empty import EmptyParams
    from survey_mc.telescope.expose import expose
    from survey_mc.telescope.response import build_response

    settings = InstrumentSettings(name="xmm_epic", vignetting=False, field_of_view=False)
    response = build_response(settings, band, EXPOSURE_S)
    rates = np.empty(N_DRAWN)
    for i in range(N_DRAWN):
        key = f"valtchanov2001/background/{band}/{i}"
        rng = partial(stream, key)
        sky = draw_sky(EmptyParams(), SkyContext(response.band, response.half_width_arcsec, rng, {}))
        counts = expose(sky, response, rng, key).observation.counts
        rates[i] = counts.sum() / counts.size / EXPOSURE_S
    return rates


def _vignetting(coefficients: tuple[float, float, float, float]) -> float:
    return float(vignetting(np.array(OFFAXIS_ARCMIN), coefficients))


def counts_at_limit() -> float:
    """Counts of the paper's limiting flux."""
    factor = float(BANDS["soft"].flux_per_rate_cgs or np.nan)
    return float(rate_from_flux(LIMIT_FLUX_CGS, factor)) * LIMIT_EXPOSURE_S


def other_core_radius(
    redshift: float, light_km_s: float = SPEED_OF_LIGHT_KM_S, h_reading: Literal["table2", "text"] = "table2"
) -> FloatArray:
    """(1,) core radius (arcsec) of our cluster; the angle goes as the inverse of the speed of light."""
    params = ClustersParams(redshifts=(redshift,), h_reading=h_reading)
    return core_radii_arcsec(params) * (SPEED_OF_LIGHT_KM_S / light_km_s)


def cluster_rate(redshift: float, band: str) -> float:
    """Count rate (ct/s) of our cluster."""
    return float(count_rates(np.array([redshift]), band)[0])
