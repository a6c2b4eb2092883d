"""How far a procedure may be from the ideal and still be sound.

Idea     wide enough for procedures as different as a wavelet and a tessellation, narrow enough for a slip of half a
         pixel, a wrong axis or an artefact to show. Who needs more says so: `Tolerances(position_pix=2.0)`.
Limits   pixels of the test fields are 4″, their PSF has a FWHM of 6″ and a half-energy width of 15″.
"""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Tolerances:
    """Bounds of the claims.

    position_pix: from an isolated source of 400 photons or more to its detection (photon noise is 0.1 pixels).
    edge_pix: the same at the border of the image or of a mask, where half of the photons are missing.
    bias_pix: mean offset of 16 bright sources along each axis; half a pixel is the slip to be found.
    same_pix, same_errors: two detections of the same photons differ by at most the sum of this many pixels and this
    many of their stated errors; same_counts: relative difference of their counts; same_share: of the bright sources,
    for which both hold (a neighbour that is split off from a source one time and not another may move it).
    pull_rms: bounds of the rms of (position − truth) / stated error. counts_ratio: bounds of the median of
    measured / true counts of bright points. counts_noise: bounds of the median of counts_err / √counts.
    exposure: relative difference of exposure_s from the map near the position. rate: relative difference of the rates
    of equal sources at full and at reduced exposure. single_photon_rows: rows an image with one photon may give.
    artefact_rows, artefact_sigma: a mask or border may add that many detections, plus that many times the square root
    of what a blank field has there anyway.
    """

    position_pix: float = 1.0
    edge_pix: float = 3.0
    bias_pix: float = 0.2
    same_pix: float = 0.15
    same_errors: float = 0.5
    same_counts: float = 0.15
    same_share: float = 0.85
    pull_rms: tuple[float, float] = (0.3, 2.5)
    counts_ratio: tuple[float, float] = (0.3, 1.6)
    counts_noise: tuple[float, float] = (0.3, 4.0)
    exposure: float = 0.05
    rate: float = 0.25
    single_photon_rows: int = 1
    artefact_rows: int = 6
    artefact_sigma: float = 4.0


# A percolated group follows the photons into the wings, and at the border into cells that are cut by it: VTP centroids
# are off by up to 3 pixels in the open and by far more in a corner.
PERCOLATED = Tolerances(position_pix=4.0, edge_pix=20.0, pull_rms=(0.3, 4.0))
KNOWN_WEAKNESSES = {"vtpdetect": PERCOLATED}


def usual_tolerances(detector_name: str) -> Tolerances:
    """The bounds for a procedure: wider ones for a published method that is known to need them."""
    return KNOWN_WEAKNESSES.get(detector_name, Tolerances())
