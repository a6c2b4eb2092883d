"""Calls that are watched: what they answered, how long they took, whether a warning slipped out."""

from __future__ import annotations

import re
import signal
import time
import traceback
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path

from survey_mc.campaign import Campaign
from survey_mc.errors import SurveyError

HANG_S = 2.0  # of CPU
GIVE_UP_S = 20.0  # of wall time, then the call is interrupted
_PLACE = re.compile(r"at line \d+, column \d+|at end of document|: line \d+|is not UTF-8 text \(byte \d+\)|top level")
_KEY = re.compile(r": (?P<key>[^:.\[]+)[^:]*: \S")


class Hang(BaseException):
    """A call that did not come back."""


@dataclass
class Tally:
    """What a number of calls answered."""

    calls: int = 0
    accepted: int = 0
    refused: int = 0
    slowest_s: float = 0.0
    tracebacks: list[str] = field(default_factory=list)
    hangs: list[str] = field(default_factory=list)
    placeless: list[str] = field(default_factory=list)

    @property
    def clean(self) -> bool:
        return not (self.tracebacks or self.hangs or self.placeless)

    def call(self, what: str, work: Callable[[], object], names_place: Callable[[str], bool]) -> None:
        """Do it; anything but an answer or one sentence that names its place is written down with `what`."""
        self.calls += 1
        start = time.process_time()
        try:
            with _limited(GIVE_UP_S), warnings.catch_warnings():
                warnings.simplefilter("error")
                work()
            self.accepted += 1
        except SurveyError as problem:
            self.refused += 1
            sentence = str(problem)
            if "\n" in sentence or len(sentence) > 2000 or not names_place(sentence):
                self.placeless.append(f"{what}: {sentence[:300]}")
        except Hang:
            self.hangs.append(what)
        except BaseException as problem:
            if isinstance(problem, KeyboardInterrupt):
                raise
            last = traceback.extract_tb(problem.__traceback__)[-1]
            self.tracebacks.append(
                f"{what}: {type(problem).__name__}: {problem} ({Path(last.filename).name}:{last.lineno})"
            )
        spent_s = time.process_time() - start
        self.slowest_s = max(self.slowest_s, spent_s)
        if spent_s > HANG_S:
            self.hangs.append(f"{what}: {spent_s:.1f} s")


@contextmanager
def _limited(seconds: float) -> Iterator[None]:
    def stop(number: int, frame: object) -> None:
        raise Hang

    before = signal.signal(signal.SIGALRM, stop)
    signal.setitimer(signal.ITIMER_REAL, seconds)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, before)


def names_campaign_place(path: str) -> Callable[[str], bool]:
    """Whether a sentence begins with the path and names the line, or the key, that is wrong."""

    def judge(sentence: str) -> bool:
        rest = sentence.removeprefix(path)
        key = _KEY.match(rest)
        text = Path(path).read_text(encoding="utf-8", errors="replace")
        known = key is not None and (key["key"] in (*Campaign.model_fields, "schema") or key["key"].strip("'") in text)
        return sentence.startswith(path) and (known or _PLACE.search(rest) is not None)

    return judge


def names_file(path: str) -> Callable[[str], bool]:
    """Whether a sentence begins with the path of the file (and the number of the unit in it)."""
    return lambda sentence: sentence.startswith(path)
