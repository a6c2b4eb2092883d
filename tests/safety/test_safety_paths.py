"""No name in a campaign, and no file on the command line, reaches beyond where it may: refused, and nothing written."""

from __future__ import annotations

import os
import socket
from pathlib import Path

import pytest
from command import command, contents
from small_campaigns import TEXT

OLD_SKY = 'kind = "lognlogs"\nflux_min_cgs = 1e-15'

# As they stand between the quotes of a TOML text.
ESCAPES = (
    "../secret.fits", "a/../../secret.fits", "..", ".", "", "/etc/passwd", "//etc/passwd", "/dev/zero", "/dev/stdin",
    "/proc/self/environ", "~/secret.fits", "~root/secret.fits", "$HOME/secret.fits", "${HOME}", "%HOME%", "`id`",
    "file:///etc/passwd", "file://localhost/etc/passwd", "http://localhost/x.fits", "https://localhost/x", "ftp://h/x",
    "s3://bucket/x", "c:secret.fits", "a\\u0000.fits", "out.fits", "loop.fits", "folder", "pipe.fits", "socket.fits",
    "dev.fits", "out/secret.fits", "gone.fits", "a" * 300 + ".fits", "a/" * 3000 + "x", "\\u202e.fits", "good.fits/x",
    "good.fits/", "-rf.fits", "|id", "good.fits;id", "*.fits", "good.fits\\n../x", "C:\\\\x.fits", "..\\\\secret.fits",
)  # fmt: skip
NAMES = (
    "../x",
    "..",
    "/tmp/x",
    "a/b",
    "~",
    "$HOME",
    "a\\u0000b",
    "x\\n",
    "",
    ".ssh",
    "-x",
    "a" * 101,
    "é",
    "CON:",
    " x",
    "x ",
)


@pytest.fixture(scope="module")
def field(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    """A good FITS image."""
    folder = tmp_path_factory.mktemp("field")
    (folder / "campaign.toml").write_text(TEXT)
    command("simulate", folder / "campaign.toml", "--out", folder / "field.fits")
    return (folder / "field.fits").read_bytes()


@pytest.fixture
def inside(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder for a campaign, with snares in it and a secret beside it."""
    folder = tmp_path / "inside"
    (folder / "folder").mkdir(parents=True)
    (tmp_path / "secret.fits").write_bytes(b"SIMPLE")
    (tmp_path / "home").mkdir()
    (tmp_path / "home" / "secret.fits").write_bytes(b"SIMPLE")
    monkeypatch.setenv("HOME", str(tmp_path / "home"))
    (folder / "good.fits").write_bytes(b"SIMPLE")
    (folder / "out.fits").symlink_to(tmp_path / "secret.fits")
    (folder / "loop.fits").symlink_to(folder / "loop.fits")
    (folder / "dev.fits").symlink_to("/dev/zero")
    (folder / "out").symlink_to(tmp_path)
    os.mkfifo(folder / "pipe.fits")
    monkeypatch.chdir(folder)
    with socket.socket(socket.AF_UNIX) as bound:
        bound.bind("socket.fits")  # relative: names of sockets are short
        yield folder


@pytest.mark.parametrize("path", ESCAPES, ids=lambda path: ascii(path[:30]))
@pytest.mark.parametrize("key", ["sky image", "network"])
def test_a_path_in_a_campaign_that_leads_elsewhere_is_refused_before_anything_is_written(
    inside: Path, path: str, key: str
) -> None:
    if key == "network":
        text = TEXT.replace('label = "G"', f'label = "G"\nparams = {{ stellarity_network = "{path}" }}')
    else:
        text = TEXT.replace(OLD_SKY, f'kind = "image"\npath = "{path}"\nscale_arcsec = 4.0')
    campaign = inside / "campaign.toml"
    campaign.write_text(text)
    before = contents(inside.parent)

    answer = command("run", campaign, "--serial")

    assert answer.code == 2
    assert answer.is_one_sentence
    assert "campaign.toml" in answer.err
    assert contents(inside.parent) == before


@pytest.mark.parametrize("name", NAMES, ids=ascii)
def test_the_name_of_a_campaign_leads_nowhere_but_into_results(inside: Path, name: str) -> None:
    campaign = inside / "campaign.toml"
    campaign.write_text(TEXT.replace('name = "small"', f'name = "{name}"'))
    before = contents(inside.parent)

    answer = command("run", campaign, "--serial")

    assert answer.code == 2
    assert "campaign.toml: name: " in answer.err
    assert contents(inside.parent) == before


@pytest.mark.parametrize("name", ["pipe.fits", "socket.fits", "folder", "loop.fits", "gone.fits", "/dev/zero", "/"])
@pytest.mark.parametrize("role", ["campaign", "image", "exposure", "background"])
def test_what_is_no_file_is_refused_wherever_a_file_is_read(inside: Path, field: bytes, name: str, role: str) -> None:
    (inside / "field.fits").write_bytes(field)
    before = contents(inside.parent)

    if role == "campaign":
        answer = command("validate", name)
    elif role == "image":
        answer = command("detect", name, "--out", "found.fits")
    else:
        answer = command("detect", "field.fits", f"--{role}", name, "--out", "found.fits")

    assert answer.code == 2
    assert answer.is_one_sentence
    assert contents(inside.parent) == before


@pytest.mark.parametrize("option", ["--out", "--regions"])
def test_a_device_or_a_pipe_is_never_replaced_by_a_result(inside: Path, field: bytes, option: str) -> None:
    (inside / "field.fits").write_bytes(field)
    before = contents(inside.parent)
    options = {"--out": "found.fits", "--regions": "found.reg"} | {option: "pipe.fits"}

    answer = command("detect", "field.fits", "--overwrite", *(word for pair in options.items() for word in pair))

    assert answer.code == 2
    assert "is a device or a pipe" in answer.err
    assert contents(inside.parent) == before
