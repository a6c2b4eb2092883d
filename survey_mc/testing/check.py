"""Trying all claims on a procedure, and what comes out.

Idea     every claim is tried and every broken one is reported, each as one sentence. Where even the plain field fails,
         the claims about fields would all say the same, so they are not judged.
Limits   the fields are drawn from the seed: a sound procedure near a tolerance may break a claim with another seed.
"""

from __future__ import annotations

import time
import traceback
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from survey_mc.detect import Detector, DetectorContractError, DetectorParams
from survey_mc.registry import UnknownName
from survey_mc.testing.case import Case, Skipped
from survey_mc.testing.claim import Claim, NotApplicable, Violation
from survey_mc.testing.extremes import EXTREME_CLAIMS
from survey_mc.testing.form import FORM_CLAIMS
from survey_mc.testing.masks import MASK_CLAIMS
from survey_mc.testing.place import PLACE_CLAIMS
from survey_mc.testing.purity import PURITY_CLAIMS
from survey_mc.testing.record import RECORD_CLAIMS
from survey_mc.testing.tolerances import Tolerances, usual_tolerances
from survey_mc.testing.values import VALUE_CLAIMS

CLAIMS: tuple[Claim, ...] = (
    *RECORD_CLAIMS[:1],
    *FORM_CLAIMS,
    *PURITY_CLAIMS,
    *PLACE_CLAIMS,
    *VALUE_CLAIMS,
    *EXTREME_CLAIMS,
    *MASK_CLAIMS,
    *RECORD_CLAIMS[1:],
)
FIRST_CLAIM = "rows_are_valid"  # without it the others say nothing of their own

Status = Literal["kept", "broken", "not applicable", "not judged"]


@dataclass(frozen=True, slots=True)
class Verdict:
    """What became of a claim; sentence: why, empty if it was kept."""

    claim: Claim
    status: Status
    sentence: str
    seconds: float


@dataclass(frozen=True, slots=True)
class Conformance:
    """The verdicts on a procedure, in the order of the claims."""

    detector: Detector
    verdicts: tuple[Verdict, ...]

    @property
    def broken(self) -> tuple[Verdict, ...]:
        return tuple(verdict for verdict in self.verdicts if verdict.status == "broken")

    @property
    def sound(self) -> bool:
        """True if no claim is broken."""
        return not self.broken


class ConformanceError(AssertionError):
    """A procedure breaks claims; the message has one line for each, `conformance` has all verdicts."""

    def __init__(self, conformance: Conformance) -> None:
        self.conformance = conformance
        detector, broken = conformance.detector, conformance.broken
        head = f"detector {detector.name!r} version {detector.version} breaks {len(broken)} of "
        lines = [f"  {verdict.claim.name}: {verdict.sentence}" for verdict in broken]
        super().__init__("\n".join([f"{head}{len(conformance.verdicts)} claims", *lines]))


def claims(*names: str) -> tuple[Claim, ...]:
    """The claims of these names, all of them without a name; raises `UnknownName`."""
    by_name = {claim.name: claim for claim in CLAIMS}
    for name in names:
        if name not in by_name:
            raise UnknownName("claim", name, by_name)
    return tuple(by_name[name] for name in names) if names else CLAIMS


def check_detector(
    detector: Detector,
    params: DetectorParams | None = None,
    *,
    claims: Iterable[Claim] | None = None,
    tolerances: Tolerances | None = None,
    seed: int = 0,
    grants_background: bool = False,
) -> Conformance:
    """Try the claims on a procedure; raises `ConformanceError` (an AssertionError) that lists those it breaks.

    params: the profile "paper" unless given. claims: all of `CLAIMS` unless given. tolerances: bounds to use instead of
    the usual ones (`usual_tolerances`). seed: of the fields and of the procedure. grants_background: the fields come
    with their background map, for procedures that need one.
    """
    conformance = conformance_of(
        detector, params, claims=claims, tolerances=tolerances, seed=seed, grants_background=grants_background
    )
    if not conformance.sound:
        raise ConformanceError(conformance)
    return conformance


def conformance_of(
    detector: Detector,
    params: DetectorParams | None = None,
    *,
    claims: Iterable[Claim] | None = None,
    tolerances: Tolerances | None = None,
    seed: int = 0,
    grants_background: bool = False,
) -> Conformance:
    """The verdicts of `check_detector`, without an error for broken claims."""
    chosen = params or detector.profiles.get("paper", detector.tiny)
    case = Case(detector, chosen, tolerances or usual_tolerances(detector.name), seed, grants_background)
    verdicts: list[Verdict] = []
    hopeless = ""
    for claim in CLAIMS if claims is None else claims:
        verdict = Verdict(claim, "not judged", hopeless, 0.0) if hopeless else _verdict(claim, case)
        if verdict.status == "broken" and claim.name == FIRST_CLAIM:
            hopeless = f"{claim.name} is broken"
        verdicts.append(verdict)
    return Conformance(detector, tuple(verdicts))


def _verdict(claim: Claim, case: Case) -> Verdict:
    start = time.perf_counter()
    status: Status = "broken"
    sentence = ""
    try:
        claim(case)
        status = "kept"
    except NotApplicable as reason:
        status, sentence = "not applicable", str(reason)
    except Violation as violation:
        sentence = str(violation)
    except Skipped as skipped:
        sentence = f"expected rows; found a skip: {skipped.reason}"
    except DetectorContractError as problem:
        sentence = f"expected rows that keep the contract; found {problem}"
    except (Exception, SystemExit) as problem:  # of a procedure that anyone may have written
        sentence = f"expected rows; found {type(problem).__name__}: {problem} ({_place(problem)})"
    return Verdict(claim, status, sentence, time.perf_counter() - start)


def _place(problem: BaseException) -> str:
    last = traceback.extract_tb(problem.__traceback__)[-1]
    return f"{Path(last.filename).name}, line {last.lineno}"
