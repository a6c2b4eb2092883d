"""Folders that are read-only, closed or missing, and names of every kind: it works, or one sentence says why not."""

from __future__ import annotations

import os
import shutil
from collections.abc import Iterator
from pathlib import Path

import pytest
from command import Answer, command
from ordinary_user import ordinary_user
from small_campaigns import TEXT

SMALLER = TEXT.replace("realisations = 6", "realisations = 1").replace("n_pix = 128", "n_pix = 64")
NAMES = {
    "spaces and signs of all kinds": 'a b  Größe ★ 日本 e\u0301 🔭 it\'s "x" $(id);`id`|& %s{0}',
    "leading hyphen": "-rf",
    "newline": "a\nb",
    "255 bytes": "x" * 250,
    "255 bytes of unicode": "é" * 125,
}


@pytest.fixture(scope="module")
def good(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A campaign, one of its fields, and its finished run."""
    folder = tmp_path_factory.mktemp("good")
    (folder / "good.toml").write_text(SMALLER)
    assert command("simulate", folder / "good.toml", "--out", folder / "good.fits").code == 0
    assert command("run", folder / "good.toml", "--serial", "--no-report", "--out", folder / "done").code == 0
    return folder


@pytest.fixture
def place(good: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """A copy of the good things; permissions are given back at the end."""
    monkeypatch.chdir(tmp_path)
    shutil.copytree(good, tmp_path, dirs_exist_ok=True)
    yield tmp_path
    for folder, names, files in os.walk(tmp_path):
        for name in (*names, *files):
            (Path(folder) / name).chmod(0o755)


@pytest.mark.parametrize("name", NAMES.values(), ids=NAMES.keys())
def test_a_name_of_any_kind_serves_for_every_file(place: Path, name: str) -> None:
    folder = place / name
    folder.mkdir()
    for suffix in (".toml", ".fits"):
        (folder / (name + suffix)).write_bytes((place / f"good{suffix}").read_bytes())
    campaign, image = folder / f"{name}.toml", folder / f"{name}.fits"

    assert command("run", campaign, "--serial", "--no-report", "--out", folder / "run").code == 0
    assert command("status", folder / "run").code == 0
    assert command("detect", image, "--method", "gauss_se", "--out", folder / f"{name[:-1]}.fits").code == 0


@pytest.mark.parametrize("verb", ["run", "plan", "validate", "detect", "report", "status", "verify", "simulate"])
@pytest.mark.parametrize("name", ["x" * 256, "x" * 5000, "gone/x", "good.toml/x"])
def test_a_name_that_cannot_be_is_one_sentence(place: Path, verb: str, name: str) -> None:
    arguments = {
        "run": (("run", name), ("run", "good.toml", "--serial", "--no-report", "--out", name)),
        "plan": (("plan", name),),
        "validate": (("validate", name),),
        "detect": (("detect", name, "--out", "c.fits"), ("detect", "good.fits", "--out", name)),
        "simulate": (("simulate", name, "--out", "x.fits"), ("simulate", "good.toml", "--out", name)),
    }
    for words in arguments.get(verb, ((verb, name),)):
        answer = command(*words)
        if words[:2] == ("run", "good.toml") and name == "gone/x":
            assert answer.code == 0  # a run makes its folders
        else:
            assert_refused(answer)


def assert_refused(answer: Answer) -> None:
    assert answer.code == 2
    assert answer.is_one_sentence
    assert answer.out == ""


CLOSED = {
    "campaign that may not be read": ("good.toml", 0o000, ("validate", "good.toml")),
    "image that may not be read": ("good.fits", 0o000, ("detect", "good.fits", "--out", "c.fits")),
    "exposure that may not be read": (
        "map.fits",
        0o000,
        ("detect", "good.fits", "--exposure", "map.fits", "--out", "c.fits"),
    ),
    "folder of the campaign that is closed": ("closed", 0o000, ("validate", "closed/good.toml")),
    "folder of the image that is closed": ("closed", 0o000, ("detect", "closed/good.fits", "--out", "c.fits")),
    "folder of a network that is closed": ("nets", 0o000, ("validate", "network.toml")),
    "network that may not be read": ("nets/own.nnw", 0o000, ("validate", "network.toml")),
    "run in a read-only folder": ("closed", 0o555, ("run", "good.toml", "--serial", "--out", "closed/run")),
    "run in a closed folder": ("closed", 0o000, ("run", "good.toml", "--serial", "--out", "closed/run")),
    "run directory that is read-only": ("closed", 0o555, ("run", "good.toml", "--serial", "--out", "closed")),
    "catalogue in a read-only folder": ("closed", 0o555, ("detect", "good.fits", "--out", "closed/c.fits")),
    "catalogue in a closed folder": ("closed", 0o000, ("detect", "good.fits", "--out", "closed/c.fits")),
    "field in a read-only folder": ("closed", 0o555, ("simulate", "good.toml", "--out", "closed/f.fits")),
    "default results in a read-only folder": (".", 0o555, ("run", "good.toml", "--serial")),
    "status of a closed run": ("done", 0o000, ("status", "done")),
    "report of a closed run": ("done", 0o000, ("report", "done")),
    "run whose lock file may not be read": ("done/campaign.lock.json", 0o000, ("status", "done")),
    "run whose manifest may not be read": ("done/manifest.jsonl", 0o000, ("status", "done")),
    "run whose manifest may not be written": (
        "done/manifest.jsonl",
        0o444,
        ("run", "more.toml", "--serial", "--out", "done"),
    ),
    "run whose store is read-only": ("done/store/tmp", 0o555, ("run", "more.toml", "--serial", "--out", "done")),
    "run whose journals are read-only": ("done/runs", 0o555, ("run", "more.toml", "--serial", "--out", "done")),
}


@pytest.mark.parametrize("case", CLOSED, ids=lambda case: case.replace(" ", "_"))
def test_what_permissions_forbid_is_one_sentence(place: Path, case: str) -> None:
    name, mode, words = CLOSED[case]
    (place / "closed").mkdir()
    for other in ("closed/good.toml", "closed/good.fits", "map.fits"):
        (place / other).write_bytes((place / f"good{other[-5:]}").read_bytes())
    (place / "nets").mkdir()
    (place / "nets" / "own.nnw").write_text("NNW\n")
    network = 'label = "G"\nparams = { stellarity_network = "nets/own.nnw" }'
    (place / "network.toml").write_text(SMALLER.replace('label = "G"', network))
    if "done" in words:
        (place / "more.toml").write_text(SMALLER.replace("realisations = 1", "realisations = 2"))
    (place / name).chmod(mode)

    with ordinary_user():
        answer = command(*words)

    assert answer.is_one_sentence, answer.err
    assert answer.code == 2
