"""Claims about the record of a procedure: what can be told without a field, and that all of it works."""

from __future__ import annotations

import tempfile
from pathlib import Path

import numpy as np

from survey_mc.detect import declared_columns, native_columns, record_problem
from survey_mc.fits import read_catalogue, write_catalogue
from survey_mc.testing import fields
from survey_mc.testing.case import Case
from survey_mc.testing.claim import claims_of, expect

SMALL_SHAPES = ((1, 1), (1, 64), (5, 3), (16, 24), (40, 33))


def record_is_complete(case: Case) -> None:
    """The record has a name, a version, a reference, the profile "paper", described parameters, columns and flags, and
    column names that FITS can tell apart."""
    problem = record_problem(case.detector)
    expect(problem is None, "a record without a mistake", problem)


def parameters_pass_through_a_campaign(case: Case) -> None:
    """Every profile is the same after it was written as JSON and read strictly, as a campaign does."""
    for name, params in case.detector.profiles.items():
        again = case.detector.params.model_validate_json(params.model_dump_json(), strict=True)
        expect(again == params, f"profile {name!r} unchanged by JSON", again)


def every_profile_runs(case: Case) -> None:
    """Every profile, and the parameters for quick tests, give rows for a plain field (with its background granted)."""
    plain = case.plain
    granted = fields.observe(
        fields.photons_of(plain.observation),
        plain.observation.exposure_s,
        np.full(fields.SHAPE, fields.BACKGROUND_PER_PIX),
    )
    for name, params in (*case.detector.profiles.items(), ("tiny", case.detector.tiny)):
        found = case.find(granted, params)
        expect(len(found) > 0, f"detections with profile {name!r}", "none")


def small_images_work_or_are_refused(case: Case) -> None:
    """On an image of any size the procedure works, or `check` refuses the parameters with a ValueError beforehand."""
    for shape in SMALL_SHAPES:
        try:
            if case.detector.check is not None:
                case.detector.check(case.params, shape)
        except ValueError as refusal:
            expect(bool(str(refusal).strip()), f"a sentence why {shape} is refused", "an empty ValueError")
            continue
        positions = np.array([[shape[1] / 2.0, shape[0] / 2.0]])
        drawn = case.draw(f"small {shape}", positions, 100.0, background_per_pix=1.0, shape=shape)
        try:
            case.find(drawn.observation)
        except Exception as problem:
            found = f"{type(problem).__name__}: {problem}"
            expect(False, f"rows for an image of {shape[0]} × {shape[1]} pixels, which `check` accepts", found)


def catalogue_comes_back(case: Case) -> None:
    """Rows written as a FITS catalogue come back as they were, under their native names too."""
    rows = case.plain_rows
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "catalogue.fits"
        write_catalogue(path, rows, detector=case.detector, params=case.params, observation=case.plain.observation)
        again = read_catalogue(path).detections
    pairs = [(c.name, c.name) for c in declared_columns(case.detector)]
    pairs += [(c.name, same) for c, same in native_columns(case.detector)]
    for name, same in pairs:
        equal = again[name].tolist() == rows[same].tolist() or np.array_equal(again[name], rows[same], equal_nan=True)
        expect(equal, f"column {name} as it was written", f"{again[name].tolist()[:3]} …")


RECORD_CLAIMS = claims_of(
    record_is_complete,
    parameters_pass_through_a_campaign,
    every_profile_runs,
    small_images_work_or_are_refused,
    catalogue_comes_back,
)
