"""Some hundreds of the mutants of `tests/faults/fuzz.py`: answers and sentences, no traceback, no hang."""

from __future__ import annotations

import random
from pathlib import Path

import numpy as np
from mutants import good_fits, mutated_campaign, mutated_fits, seeds
from watched import Tally, names_campaign_place, names_file

from survey_mc.campaign import load_campaign
from survey_mc.fits import read_counts_image, read_sky_image

N_CAMPAIGNS, N_FITS = 300, 100


def test_mutated_campaigns_are_refused_with_file_and_place(tmp_path: Path) -> None:
    tally, rng, texts = Tally(), random.Random(290), seeds()
    path = tmp_path / "mutant.toml"
    for number in range(N_CAMPAIGNS):
        path.write_bytes(mutated_campaign(rng, texts))
        tally.call(f"campaign {number}", lambda: load_campaign(path), names_campaign_place(str(path)))

    assert tally.clean, tally
    assert tally.accepted > 5
    assert tally.refused > N_CAMPAIGNS // 2


def test_mutated_fits_headers_are_refused_with_the_file(tmp_path: Path) -> None:
    tally, rng, originals = Tally(), np.random.default_rng(291), good_fits(tmp_path)
    path = tmp_path / "mutant.fits"
    for number in range(N_FITS):
        whole, n_header = originals[number % 2]
        path.write_bytes(mutated_fits(whole, n_header, rng))
        tally.call(f"FITS {number}", lambda: read_counts_image(path), names_file(str(path)))
        tally.call(f"sky {number}", lambda: read_sky_image(path, unit="ct/s"), names_file(str(path)))

    assert tally.clean, tally
    assert tally.accepted > 5
    assert tally.refused > N_FITS // 2


def test_the_watch_sees_what_it_looks_for(tmp_path: Path) -> None:
    tally = Tally()
    path = tmp_path / "mutant.toml"
    path.write_text("x = 1")

    tally.call("crash", lambda: 1 / 0, names_file("x"))
    tally.call("sentence without place", lambda: load_campaign(path), lambda sentence: False)
    tally.call("warning", lambda: np.float64(1e300) * np.float64(1e300), names_file("x"))

    assert len(tally.tracebacks) == 2
    assert len(tally.placeless) == 1
    assert not names_campaign_place(str(path))(f"{path}: is bad")
    assert names_campaign_place(str(path))(f"{path}: x: is bad")
