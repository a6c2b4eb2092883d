"""Mutated campaign files and FITS headers: nothing but answers and sentences may come back.

10,000 campaign files are loaded, and those that are good drawn once and locked as a run would; 2,000 FITS files are
read as counts image, exposure map, background map and predicted sky, and those that are good searched and written as
a catalogue. No traceback, no warning, no call of more than 2 s of CPU; every sentence names the file, and in a campaign
the line (of what is no TOML) or the key. About 4 minutes.
"""

from __future__ import annotations

import argparse
import random
import resource
import sys
import tempfile
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1]))
sys.path.insert(0, str(Path(__file__).parents[1] / "safety"))
sys.path.insert(0, str(Path(__file__).parents[2]))

import numpy as np
from mutants import good_fits, mutated_campaign, mutated_fits, seeds
from watched import Tally, names_campaign_place, names_file

from survey_mc.campaign import draw_field, expand, load_campaign, lock_content
from survey_mc.fits import (
    observation_from_files,
    read_counts_image,
    read_sky_image,
    write_catalogue,
    write_regions,
)
from survey_mc.run import detect_image
from survey_mc.telescope.psf import KingPsf

MEMORY_BYTES = 4_000_000_000
PSF = KingPsf.from_fwhm_hew(6.0, 15.0)


def fuzz_campaigns(folder: Path, n: int, seed: int) -> Tally:
    """Load n mutants; draw a field of those that are good."""
    tally, rng, texts = Tally(), random.Random(seed), seeds()
    path = folder / "mutant.toml"

    def use() -> None:
        campaign = load_campaign(path)
        lock_content(campaign)
        draw_field(campaign, expand(campaign)[0], 0)

    for number in range(n):
        path.write_bytes(mutated_campaign(rng, texts))
        tally.call(f"campaign {number}", use, names_campaign_place(str(path)))
    return tally


def fuzz_fits(folder: Path, n: int, seed: int) -> Tally:
    """Read n mutants in every role; search those that are good images."""
    tally, rng = Tally(), np.random.default_rng(seed)
    originals = good_fits(folder)
    good, path = folder / "good0.fits", folder / "mutant.fits"
    catalogue, regions = folder / "found.fits", folder / "found.reg"

    def search() -> None:
        found = detect_image(path, "gauss_se", pixel_scale_arcsec=None)
        write_catalogue(
            catalogue, found.detections, detector=found.detector, params=found.params,
            observation=found.source.observation, facts=found.source.facts, overwrite=True,
        )  # fmt: skip
        write_regions(regions, found.detections, found.source.observation, overwrite=True)

    def is_image() -> bool:
        try:
            read_counts_image(path)
        except Exception:  # counted where it is the subject
            return False
        return True

    for number in range(n):
        whole, n_header = originals[number % 2]
        path.write_bytes(mutated_fits(whole, n_header, rng))
        name, place = f"FITS {number}", names_file(str(path))
        tally.call(name, lambda: read_counts_image(path), place)
        tally.call(name + " as a map", lambda: observation_from_files(good, psf=PSF, exposure_path=path), place)
        tally.call(
            name + " as a background", lambda: observation_from_files(good, psf=PSF, background_path=path), place
        )
        tally.call(name + " as a sky", lambda: read_sky_image(path, unit="ct/s"), place)
        if is_image():
            tally.call(name + " searched", search, place)
    return tally


def report(label: str, n: int, tally: Tally) -> bool:
    """One line, and what went wrong."""
    for line in (*tally.tracebacks[:20], *tally.hangs[:20], *tally.placeless[:20]):
        print(f"  {line}")
    print(
        f"R29 {label}: {n} mutants, {tally.calls} calls: {tally.accepted} answered, {tally.refused} refused, "
        f"{len(tally.tracebacks)} tracebacks, {len(tally.hangs)} longer than 2 s (slowest {tally.slowest_s:.2f} s), "
        f"{len(tally.placeless)} without place; bar 0, 0, 0"
    )
    return tally.clean


def main() -> int:
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("--n", type=int, default=10_000, help="mutated campaigns")
    options.add_argument("--n-fits", type=int, default=2_000, help="mutated FITS files")
    options.add_argument("--seed", type=int, default=29)
    chosen = options.parse_args()
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY_BYTES, MEMORY_BYTES))
    with tempfile.TemporaryDirectory() as folder:
        clean = report("campaigns", chosen.n, fuzz_campaigns(Path(folder), chosen.n, chosen.seed))
        clean &= report("FITS", chosen.n_fits, fuzz_fits(Path(folder), chosen.n_fits, chosen.seed))
    return 0 if clean else 1


if __name__ == "__main__":
    sys.exit(main())
