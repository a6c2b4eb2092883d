"""Stellarity: SExtractor's neural star/galaxy index, CLASS_STAR.

Idea     a network looks at ten numbers of an object: its eight isophotal areas in units of the seeing disc, its peak
         over the threshold, and the seeing. It answers 0 for an extended and 1 for a point source; between them the
         probability of a point, for populations as numerous as each other.
Source   Bertin & Arnouts 1996 A&AS 117, 393, Sect. 8; paper Sect. 3.5 (the seeing is tuned to the mean PSF). The
         weights are our own, trained on simulated X-ray fields (`survey-mc train-stellarity`); SExtractor's file of
         weights, made for optical images, can be given instead.
Limits   an index for objects like those of the training: filter, pixel and PSF the same to some ten per cent. A blend
         of points looks extended.
"""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np

from survey_mc.detect._sextractor.nnw import Network, read_network
from survey_mc.errors import BadInput
from survey_mc.types import FloatArray, IntImage

SHIPPED_NETWORKS = ("xmm_epic",)
FILE_SUFFIX = ".nnw"
N_INPUTS = 10
AREA_OF_NONE = 0.01  # stands for an area of no pixel, in units of the squared seeing FWHM
_FOLDER = Path(__file__).parent / "networks"


def is_shipped(network: str) -> bool:
    """Whether a parameter names a network of the package, and not a file."""
    return network in SHIPPED_NETWORKS


def open_network(network: str) -> Network:
    """A shipped network, or that of a file; `BadInput` if it cannot classify sources."""
    found = read_network(_FOLDER / f"{network}{FILE_SUFFIX}" if is_shipped(network) else network)
    if (found.sizes[0], found.sizes[-1]) != (N_INPUTS, 1):
        raise BadInput(
            network,
            f"must be a network of {N_INPUTS} inputs and 1 output (got {found.sizes[0]} and {found.sizes[-1]})",
        )
    return found


def network_inputs(
    areas_pix: IntImage, peak_over_threshold: FloatArray, seeing_arcsec: float, scale_arcsec: float
) -> FloatArray:
    """The ten inputs (n, 10) in SExtractor's order.

    areas_pix: (n, 8) isophotal areas. peak_over_threshold: (n,), > 0. seeing_arcsec: FWHM of a point source in the
    searched image; scale_arcsec: side of a pixel.
    """
    disc_pix = (seeing_arcsec / scale_arcsec) ** 2
    size = np.log10(np.where(areas_pix > 0, areas_pix / disc_pix, AREA_OF_NONE))
    brightness = np.log10(peak_over_threshold)
    seeing = np.full(len(areas_pix), math.log10(seeing_arcsec))
    return np.column_stack([size[:, 0], brightness, size[:, 1:], seeing])


def stellarity(
    areas_pix: IntImage,
    peak_over_threshold: FloatArray,
    seeing_arcsec: float,
    scale_arcsec: float,
    network: Network,
) -> FloatArray:
    """Index of each object (n,): 0 extended … 1 point; for the arguments see `network_inputs`."""
    inputs = network_inputs(areas_pix, peak_over_threshold, seeing_arcsec, scale_arcsec)
    return np.clip(network.response(inputs)[:, 0], 0.0, 1.0)
