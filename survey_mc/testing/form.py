"""Claims about the rows and the view of a procedure on a plain field."""

from __future__ import annotations

import numpy as np

from survey_mc.detect import check_detections
from survey_mc.testing import fields
from survey_mc.testing.case import Case, positions_of
from survey_mc.testing.claim import NotApplicable, claims_of, expect
from survey_mc.types import Observation, Skip


def rows_are_valid(case: Case) -> None:
    """A plain field with bright sources gives rows that keep the contract: columns, types, finite values."""
    expect(len(case.plain_rows) > 0, f"detections of {len(case.plain.counts)} bright sources", "none")


def rows_are_ranked(case: Case) -> None:
    """Rows are ordered by decreasing significance."""
    significance = case.plain_rows["significance"].to_numpy()
    steps = np.flatnonzero(np.diff(significance) > 0.0)
    expect(len(steps) == 0, "decreasing significance", f"a rise after row {steps[:1]}")


def rows_are_distinct(case: Case) -> None:
    """No two detections are at the same place."""
    positions = positions_of(case.plain_rows)
    n_distinct = len(np.unique(positions, axis=0))
    expect(n_distinct == len(positions), f"{len(positions)} different places", n_distinct)


def flags_are_documented(case: Case) -> None:
    """Every bit of `flags` that is raised has a meaning in `flag_bits`."""
    raised = np.bitwise_or.reduce(case.plain_rows["flags"].to_numpy(), initial=0)
    known = sum(case.detector.flag_bits)
    expect(not raised & ~known, f"only documented bits of flags ({known:b})", f"{raised:b}")


def photon_list_is_optional(case: Case) -> None:
    """Without a photon list the procedure works on the image, or skips with a reason."""
    plain = case.plain.observation
    binned = Observation(plain.counts, None, plain.exposure_s, plain.background, plain.psf, plain.grid, plain.band)
    found = case.detector.detect(binned, case.params, case.rng("detect"))
    if isinstance(found, Skip):
        expect(bool(found.reason.strip()), "a reason for the skip", "an empty text")
    else:
        rows = check_detections(case.detector, binned, found)
        expect(len(rows) > 0, "detections of bright sources on a binned image", "none")


def view_is_an_image(case: Case) -> None:
    """`view` gives a finite image of the shape of the field, also where nothing was observed."""
    if case.detector.view is None:
        raise NotApplicable("the procedure has no view")
    unobserved = fields.observe(np.zeros((0, 2)), np.zeros(fields.SHAPE), np.zeros(fields.SHAPE))
    for name, observation in (("the plain field", case.plain.observation), ("an unobserved field", unobserved)):
        image = np.asarray(case.detector.view(observation, case.params))
        expect(image.shape == fields.SHAPE, f"a view of shape {fields.SHAPE} of {name}", image.shape)
        expect(image.dtype.kind == "f" and bool(np.all(np.isfinite(image))), f"finite floats for {name}", image.dtype)


FORM_CLAIMS = claims_of(
    rows_are_valid, rows_are_ranked, rows_are_distinct, flags_are_documented, photon_list_is_optional, view_is_an_image
)
