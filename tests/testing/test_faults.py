"""The kit notices what is wrong: every claim has a fault that breaks it, and the report says so."""

from __future__ import annotations

from dataclasses import replace

import pytest
from planted_faults import FAULTS, SOUND, failing

from survey_mc import testing
from survey_mc.detect import Detector
from survey_mc.registry import UnknownName


@pytest.mark.parametrize(("claim", "detector"), [fault[1:] for fault in FAULTS], ids=[fault[0] for fault in FAULTS])
def test_a_planted_fault_is_reported_by_its_claim(claim: str, detector: Detector) -> None:
    with pytest.raises(testing.ConformanceError, match=rf"{claim}: expected .*; found "):
        testing.check_detector(detector, claims=testing.claims(claim))


def test_every_claim_has_a_planted_fault() -> None:
    assert {claim for _, claim, _ in FAULTS} == {claim.name for claim in testing.CLAIMS}


def test_the_report_lists_what_is_broken_and_nothing_else() -> None:
    broken = failing(lambda obs: obs.counts.sum() < 2, ZeroDivisionError("no photons"))

    with pytest.raises(testing.ConformanceError) as caught:
        testing.check_detector(broken)

    head, *lines = str(caught.value).splitlines()
    assert head == f"detector 'gauss_se' version {broken.version} breaks 2 of {len(testing.CLAIMS)} claims"
    assert [line.split(":")[0].strip() for line in lines] == ["empty_image_gives_no_rows", "one_photon_is_survived"]
    assert "found ZeroDivisionError: no photons (planted_faults.py, line " in lines[0]
    assert [v.claim.name for v in caught.value.conformance.broken] == [line.split(":")[0].strip() for line in lines]


def test_where_the_plain_field_fails_the_rest_is_not_judged() -> None:
    found = testing.conformance_of(failing(lambda obs: True, RuntimeError("never ready")))

    assert [verdict.claim.name for verdict in found.broken] == ["rows_are_valid"]
    assert {verdict.status for verdict in found.verdicts[2:]} == {"not judged"}
    assert {verdict.sentence for verdict in found.verdicts[2:]} == {"rows_are_valid is broken"}


def test_what_a_procedure_does_not_offer_is_not_held_against_it() -> None:
    found = testing.check_detector(replace(SOUND, view=None), claims=testing.claims("view_is_an_image"))

    assert [(verdict.status, verdict.sentence) for verdict in found.verdicts] == [
        ("not applicable", "the procedure has no view")
    ]


def test_a_tolerance_can_be_loosened_and_tightened() -> None:
    claim = testing.claims("bright_sources_are_found_in_place")
    off = next(detector for name, _, detector in FAULTS if name == "far off")

    testing.check_detector(off, claims=claim, tolerances=testing.Tolerances(position_pix=6.0))
    with pytest.raises(testing.ConformanceError, match=r"within 0\.01 pixels"):
        testing.check_detector(SOUND, claims=claim, tolerances=testing.Tolerances(position_pix=0.01))


def test_procedures_that_need_a_background_are_given_one_when_asked() -> None:
    params = SOUND.params(background="granted")  # type: ignore[call-arg]
    claims = testing.claims("rows_are_valid", "turned_sky_gives_turned_sources", "mask_makes_no_sources")

    testing.check_detector(SOUND, params, claims=claims, grants_background=True)
    with pytest.raises(testing.ConformanceError, match="needs an observation with a background map"):
        testing.check_detector(SOUND, params, claims=claims)


def test_an_unknown_claim_lists_the_known_ones() -> None:
    with pytest.raises(UnknownName, match="did you mean 'view_is_an_image'"):
        testing.claims("view_is_image")


def test_claims_read_as_sentences() -> None:
    names = [claim.name for claim in testing.CLAIMS]

    assert len(set(names)) == len(names)
    assert all(claim.about.endswith(".") for claim in testing.CLAIMS)
    assert testing.claims() == testing.CLAIMS
