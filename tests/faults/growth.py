"""R8, R9, R10: a finished run is started again, grows, and is changed; only what is new may be computed.

R8   the finished run once more: no order, no file touched, its wall time.
R9   realisations 100 → 150, a method more, an exposure more, another matching radius: no field is drawn, searched or
     matched twice for one key, no old file is touched except the last, unfilled one of a cell, and the data files are
     those of a fresh run (which has no files of the state before).
R10  a comment and another order of the keys: nothing is computed; a physics key of one cell: that cell alone is.

About three minutes.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

from fault_tools import MR1, TEXT, finish, hashes, start, verdict

from survey_mc.run import open_run

SECONDS_BAR = 2.0
PER_FILE = 25  # 100 and 150 realisations fill whole files
BASE = TEXT.replace("realisations = 6", "realisations = 100").replace(
    "realisations_per_file = 4", f"realisations_per_file = {PER_FILE}"
)


def swap(old: str, new: str) -> Callable[[str], str]:
    def change(text: str) -> str:
        assert old in text, old
        return text.replace(old, new)

    return change


def other_order(text: str) -> str:
    """A comment, and the keys of two tables the other way round."""
    swapped = swap(
        'band = ["soft"]\nexposure_ks = [10.0]\nrealisations = 100',
        'realisations = 100\nexposure_ks = [10.0]\nband = ["soft"] # a band',
    )(text)
    return "# A comment.\n" + swap("n_pix = 128\nfield_of_view = false", "field_of_view = false\nn_pix = 128")(swapped)


# What is changed, and how many fields may be drawn, searched and matched for it.
GROWTH: dict[str, tuple[Callable[[str], str], tuple[int, int, int]]] = {
    "realisations 100 to 150": (swap("realisations = 100", "realisations = 150"), (50, 50, 50)),
    "a method more": (lambda text: text + MR1, (100, 100, 100)),
    "an exposure more": (swap("[10.0]", "[10.0, 20.0]"), (100, 100, 100)),
    "another matching radius": (swap("counts_min = 10", "counts_min = 10\nradius_arcsec = 12.0"), (100, 0, 100)),
    "a comment and another order of keys": (other_order, (0, 0, 0)),
    "another exposure in one of two cells": (swap("[10.0, 20.0]", "[10.0, 30.0]"), (100, 100, 100)),
    "a procedure's parameter": (swap('label = "G"', 'label = "G"\nparams = { fwhm_arcsec = 10.0 }'), (100, 100, 100)),
}


def spent(root: Path) -> tuple[int, int, int]:
    """Fields drawn, searched and matched so far, from the journal."""
    costs = open_run(root).journal()
    sums = costs.groupby("stage")["fields"].sum()
    return int(sums.get("draw", 0)), int(sums.get("detect", 0)), int(sums.get("match", 0))


def run(campaign: Path, root: Path) -> float:
    """Do a campaign with two workers, without its report; wall seconds."""
    began_s = time.monotonic()
    code, said = finish(start(campaign, root, "--workers", "2", "--no-report"))
    assert code == 0, said
    return time.monotonic() - began_s


def times(root: Path) -> dict[str, int]:
    return {str(path.relative_to(root)): path.stat().st_mtime_ns for path in (root / "store").rglob("*.parquet")}


def grows(name: str, folder: Path) -> str:
    """What is wrong with the growth of a run, empty if nothing is."""
    change, allowed = GROWTH[name]
    base = swap("[10.0]", "[10.0, 20.0]")(BASE) if "two cells" in name else BASE
    campaign = folder / "c.toml"
    campaign.write_text(base)
    root, fresh = folder / "run", folder / "fresh"
    run(campaign, root)
    old, before = times(root), spent(root)
    campaign.write_text(change(base))
    run(campaign, root)
    done = tuple(now - then for now, then in zip(spent(root), before, strict=True))
    run(campaign, fresh)
    wrong = []
    if any(n > most for n, most in zip(done, allowed, strict=True)) or done[1] < allowed[1]:
        wrong.append(f"{done} fields drawn, searched, matched instead of {allowed}")
    if {path: at for path, at in times(root).items() if path in old} != old:
        wrong.append("an old file was touched")
    wanted, found = hashes(fresh, tables=False), hashes(root, tables=False)
    wanted.pop("manifest.jsonl")
    if not wanted.items() <= found.items():
        wrong.append("data files are not those of a fresh run")
    print(f"{name}: {done} fields drawn, searched, matched; {'; '.join(wrong) or 'as wanted'}", flush=True)
    return "; ".join(wrong)


def again(folder: Path) -> tuple[int, int, float]:
    """A finished run with its report started again: fields computed, files touched, wall seconds."""
    campaign, root = folder / "c.toml", folder / "run"
    campaign.write_text(BASE)
    code, said = finish(start(campaign, root, "--workers", "2"))
    assert code == 0, said

    def stamps() -> dict[str, int]:
        return {
            str(path.relative_to(root)): path.stat().st_mtime_ns
            for path in root.rglob("*")
            if path.is_file() and path.name != ".lock"
        }

    old, before = stamps(), spent(root)
    began_s = time.monotonic()
    code, said = finish(start(campaign, root, "--workers", "2"))
    seconds = time.monotonic() - began_s
    assert code == 0, said
    now = stamps()
    touched = sum(old.get(path) != at for path, at in now.items()) + len(old.keys() - now.keys())
    return sum(spent(root)) - sum(before), touched, seconds


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.parse_args()
    with tempfile.TemporaryDirectory() as scratch:
        (folder := Path(scratch) / "again").mkdir()
        fields, touched, seconds = again(folder)
        wrong = 0
        for number, name in enumerate(GROWTH):
            (folder := Path(scratch) / str(number)).mkdir()
            wrong += bool(grows(name, folder))
    missed = verdict(
        "R8 a finished run started again",
        f"{fields} fields, {touched} files touched, {seconds:.2f} s",
        f"0, 0, < {SECONDS_BAR:g} s",
        fields == touched == 0 and seconds < SECONDS_BAR,
    )
    return missed + verdict(
        "R9, R10 what grows or changes", f"{len(GROWTH) - wrong} of {len(GROWTH)} compute only what is new", "all",
        wrong == 0,
    )  # fmt: skip


if __name__ == "__main__":
    sys.exit(bool(main()))
