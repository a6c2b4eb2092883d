"""What the training of the stellarity index needs of the procedures that have one.

Idea     a stored detection holds its isophotal areas, its peak and its threshold; with the seeing, which follows from
         the parameters, these are the inputs of the network. Any procedure whose parameters are `SepParams` has them.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from survey_mc.detect._sextractor.catalogue import N_ISOPHOTES
from survey_mc.detect._sextractor.nnw import Network, network_text, read_network, sigmoid
from survey_mc.detect._sextractor.sep_chain import SepParams
from survey_mc.detect._sextractor.stellarity import N_INPUTS, network_inputs, open_network
from survey_mc.detect.detector import DetectorParams
from survey_mc.types import FloatArray, Psf

if TYPE_CHECKING:
    from pandas import DataFrame

__all__ = [
    "INPUT_COLUMNS",
    "N_INPUTS",
    "Network",
    "has_stellarity",
    "inputs_of_detections",
    "network_text",
    "open_network",
    "read_network",
    "sigmoid",
]

_AREAS = tuple(f"iso{i}_pix" for i in range(N_ISOPHOTES))
INPUT_COLUMNS = (*_AREAS, "peak_per_pix", "threshold_per_pix")


def has_stellarity(params: DetectorParams) -> bool:
    """Whether the procedure with these parameters gives a stellarity index."""
    return isinstance(params, SepParams)


def inputs_of_detections(detections: DataFrame, params: DetectorParams, psf: Psf, scale_arcsec: float) -> FloatArray:
    """Network inputs (n, 10) of detections with `INPUT_COLUMNS`; psf: the believed one, scale_arcsec: of a pixel."""
    if not isinstance(params, SepParams):
        raise TypeError(f"{type(params).__name__} are parameters of a procedure without stellarity")
    ratio = detections["peak_per_pix"].to_numpy() / detections["threshold_per_pix"].to_numpy()
    areas_pix = detections[list(_AREAS)].to_numpy().astype(np.int32)
    return network_inputs(areas_pix, ratio, params.seeing(psf, scale_arcsec), scale_arcsec)
