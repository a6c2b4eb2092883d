"""The defaults of the procedures are the numbers of the paper (Sect. 3.4) and of its programs."""

import pytest

from survey_mc.detect import DETECTORS

SEXTRACTOR = {
    "mesh_pix": 32, "mesh_filter": 3, "deblend_levels": 64, "deblend_contrast": 0.0, "clean": True, "clean_param": 1.0,
    "kron_integration": 6.0, "kron_factor": 2.5, "kron_radius_min": 3.5, "measure_on": "filtered",
    "aperture_correction": "none", "neighbours": "mirror",
}  # fmt: skip
GAUSS = {"fwhm_arcsec": 12.0, "threshold_kind": "sigma", "threshold_sigma": 4.0, "rms": "sep_background"}
MR1 = {
    "significance": 1e-4, "n_scales": 6, "iterations": 25, "tolerance": 1e-5, "first_scale": 2, "positive_only": True,
    "positive_image": True, "kill_isolated": True, "min_events": 4, "grow_support": False, "suppress_last_scale": False,
    "reconstruction": "adjoint", "border": "mirror", "threshold_sqrt_background": 0.5,
}  # fmt: skip
LABELS = {
    "emldetect": "EMLDETECT", "vtpdetect": "VTPDETECT", "wavdetect": "WAVDETECT", "ewavelet": "EWAVELET",
    "gauss_se": "G+SE", "mr1_se": "MR/1+SE",
}  # fmt: skip


@pytest.mark.parametrize(("name", "expected"), [("gauss_se", SEXTRACTOR | GAUSS), ("mr1_se", SEXTRACTOR | MR1)])
def test_defaults_are_the_published_ones(name, expected):
    params = DETECTORS[name].params().model_dump()
    assert {key: params[key] for key in expected} == expected
    assert DETECTORS[name].profiles["paper"] == DETECTORS[name].params()


def test_clusters_are_sought_with_a_kernel_of_20_arcsec():
    assert DETECTORS["gauss_se"].profiles["paper_clusters"].model_dump()["fwhm_arcsec"] == 20.0


def test_labels_are_those_of_the_paper():
    assert {(d.name, d.label) for d in DETECTORS.built_in} <= set(LABELS.items())
