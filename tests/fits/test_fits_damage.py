"""Damaged files: whatever happens to the bytes, the answer is the right image or one sentence."""

import gzip
import warnings

import numpy as np
import pytest
from fits_samples import sample_counts, sky_header, write_image

from survey_mc.errors import BadInput
from survey_mc.fits import read_counts_image

N_CUTS = 100
N_MUTANTS = 400
WORDS = [
    b"NAXIS1",
    b"NAXIS2",
    b"BITPIX",
    b"END     ",
    b"1E999",
    b"-1",
    b"NaN",
    b"'",
    b"CRPIX9",
    b"T",
    b"\xff",
    b"\0",
    b"BZERO",
]


def read_or_refuse(path):
    """The image or None; any other exception or any warning fails the test."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        try:
            return read_counts_image(path)
        except BadInput:
            return None


@pytest.mark.parametrize("packed", [False, True])
@pytest.mark.parametrize("extension", [False, True])
def test_file_cut_anywhere_is_refused_or_complete(tmp_path, packed, extension):
    whole = write_image(tmp_path / "a.fits", packed=packed, extension=extension).read_bytes()
    path = tmp_path / "cut.fits"
    data_end = 2880 * (2 if extension else 1) + sample_counts().nbytes
    for n_bytes in np.linspace(0, len(whole) - 1, N_CUTS).astype(int):
        path.write_bytes(whole[:n_bytes])
        image = read_or_refuse(path)
        # Only the padding of the last block may be missing, and nothing at all in a packed file.
        assert (image is not None) == (n_bytes >= data_end and not packed)
        assert image is None or np.array_equal(image.counts, sample_counts())


def mutant(whole, rng, n_header):
    """A copy with flipped bits, overwritten cards, or moved pieces in the header."""
    changed = bytearray(whole)
    for _ in range(rng.integers(1, 5)):
        place = int(rng.integers(0, n_header))
        match rng.integers(0, 4):
            case 0:
                changed[place] ^= 1 << int(rng.integers(0, 8))
            case 1:
                word = WORDS[rng.integers(0, len(WORDS))]
                changed[place : place + len(word)] = word
            case 2:
                card = place // 80 * 80
                other = int(rng.integers(0, n_header // 80)) * 80
                changed[card : card + 80] = changed[other : other + 80]
            case _:
                card = place // 80 * 80 + 10
                changed[card : card + 20] = b"%20d" % rng.integers(-(2**62), 2**62)
    return bytes(changed)


@pytest.mark.parametrize("extension", [False, True])
def test_mutated_header_never_gives_a_traceback_or_a_warning(tmp_path, extension):
    cards = {
        "EXPOSURE": 100.0,
        "E_MIN": 0.5,
        "E_MAX": 2.0,
        "RA_PNT": 150.1,
        "DEC_PNT": 2.2,
        "BSCALE": 1.0,
        "BZERO": 0.0,
    }
    whole = write_image(tmp_path / "a.fits", header=sky_header(**cards), extension=extension).read_bytes()
    n_header = 2880 * (2 if extension else 1)
    path, rng = tmp_path / "mutant.fits", np.random.default_rng(29)
    n_refused = 0
    for _ in range(N_MUTANTS // 2):
        path.write_bytes(mutant(whole, rng, n_header))
        n_refused += read_or_refuse(path) is None
    assert 0 < n_refused < N_MUTANTS // 2


def test_mutated_packed_file_never_gives_another_image(tmp_path):
    whole = write_image(tmp_path / "a.fits", packed=True).read_bytes()
    path, rng = tmp_path / "mutant.fits.gz", np.random.default_rng(30)
    for _ in range(100):
        changed = bytearray(whole)
        changed[rng.integers(10, len(whole))] ^= 1 << int(rng.integers(0, 8))
        path.write_bytes(bytes(changed))
        image = read_or_refuse(path)
        if image is not None:
            assert gzip.decompress(bytes(changed)) == gzip.decompress(whole)
