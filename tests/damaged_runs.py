"""A small whole run with everything a run directory can have, to be damaged and put right again."""

from __future__ import annotations

import contextlib
import io
from pathlib import Path

import numpy as np
from astropy.io import fits

from survey_mc.cli import main

SKY_IMAGE = "sky/blob.fits"
CAMPAIGN = f"""
schema = 1
name = "damaged"
about = "64-pixel fields, with a sky image"
seed = 11

[instrument]
name = "xmm_epic"
n_pix = 64
field_of_view = false

[sky]
kind = "combined"
parts = [
    {{ kind = "lognlogs", flux_min_cgs = 2e-15 }},
    {{ kind = "image", path = "{SKY_IMAGE}", scale_arcsec = 8.0 }},
]

[grid]
band = ["soft"]
exposure_ks = [10.0]
realisations = 6

[[method]]
name = "gauss_se"
label = "G"

[[method]]
name = "mr1_se"
label = "M"
params = {{ n_scales = 4 }}

[match]
region_arcmin = 2.0
counts_min = 10

[store]
realisations_per_file = 2
"""


def write_campaign(folder: Path, *changes: tuple[str, str]) -> Path:
    """The campaign, with texts replaced, and its sky image in a folder; the path of the campaign."""
    y, x = np.mgrid[-8:8, -8:8]
    image = 2e-4 * np.exp(-(x**2 + y**2) / 18.0)
    (folder / SKY_IMAGE).parent.mkdir(parents=True, exist_ok=True)
    fits.PrimaryHDU(image.astype(np.float32)).writeto(folder / SKY_IMAGE, overwrite=True)
    text = CAMPAIGN
    for old, new in changes:
        assert old in text, old
        text = text.replace(old, new)
    path = folder / "damaged.toml"
    path.write_text(text, encoding="utf-8")
    return path


def call(*arguments: object) -> tuple[int, str]:
    """Exit code and all output of a command in this process; what is no SystemExit comes through."""
    said = io.StringIO()
    with contextlib.redirect_stdout(said), contextlib.redirect_stderr(said):
        try:
            main([str(argument) for argument in arguments])
        except SystemExit as left:
            return int(left.code or 0), said.getvalue()
    return 0, said.getvalue()


def make_run(folder: Path, *, report: bool = True) -> Path:
    """A finished run in folder/run."""
    options = () if report else ("--no-report",)
    code, said = call("run", write_campaign(folder), "--serial", "--out", folder / "run", *options)
    assert code == 0, said
    return folder / "run"


def contents(root: Path) -> dict[str, bytes]:
    """All files of a run but the lock of its process, by path."""
    paths = (path for path in root.rglob("*") if path.is_file() and path.name != ".lock")
    return {path.relative_to(root).as_posix(): path.read_bytes() for path in paths}


def times(root: Path) -> dict[str, int]:
    """When each file was written (ns)."""
    return {path: (root / path).stat().st_mtime_ns for path in contents(root)}


def restore(root: Path, whole: dict[str, bytes]) -> None:
    """Put a run back as it was."""
    for path, content in contents(root).items():
        if whole.get(path) != content:
            (root / path).unlink()
    for path, content in whole.items():
        if not (root / path).is_file():
            (root / path).parent.mkdir(parents=True, exist_ok=True)
            (root / path).write_bytes(content)


def kind_of_file(path: str) -> str:
    """What a file of a run is, in a word."""
    first = path.split("/", 1)[0]
    named = {
        "campaign.toml": "campaign",
        "campaign.lock.json": "lock",
        "manifest.jsonl": "manifest",
        "tables.sha256": "list of tables",
        "store": "stored file",
        "inputs": "input",
        "report": "report",
    }
    if first in named:
        return named[first]
    return "journal" if path.endswith(".jsonl") else "table"
