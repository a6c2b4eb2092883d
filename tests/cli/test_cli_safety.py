"""The command line destroys nothing that is not its own, and tells damage from what a killed run left behind."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import pytest
from small_campaigns import TEXT

from survey_mc.cli import main
from survey_mc.detect import DETECTORS


def call(capsys: pytest.CaptureFixture[str], *arguments: object) -> tuple[int, str, str]:
    with pytest.raises(SystemExit) as left:
        main([str(argument) for argument in arguments])
    captured = capsys.readouterr()
    return int(left.value.code or 0), captured.out, captured.err


@pytest.fixture
def campaign(tmp_path: Path) -> Path:
    path = tmp_path / "small.toml"
    path.write_text(TEXT)
    return path


@pytest.fixture
def root(campaign: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> Path:
    assert call(capsys, "run", campaign, "--serial", "--no-report", "--out", tmp_path / "run")[0] == 0
    return tmp_path / "run"


def contents(folder: Path) -> dict[str, bytes]:
    return {str(p.relative_to(folder)): p.read_bytes() for p in folder.rglob("*") if p.is_file() and p.name != ".lock"}


def test_no_file_that_is_read_is_overwritten(
    campaign: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    image = tmp_path / "field.fits"
    call(capsys, "simulate", campaign, "--out", image)
    before = contents(tmp_path)

    for arguments in (
        ("detect", image, "--out", image, "--overwrite"),
        ("detect", image, "--out", tmp_path / "c.fits", "--regions", tmp_path / "c.fits"),
        ("detect", image, "--exposure", image, "--out", tmp_path / "c.fits", "--regions", image, "--overwrite"),
        ("simulate", campaign, "--out", campaign, "--overwrite"),
    ):
        assert call(capsys, *arguments)[0] == 2
    assert contents(tmp_path) == before


@pytest.mark.parametrize("setting", ["n_scales='5'", "n_scales=5.5", "n_scales=true", "n_scales=1979-05-27"])
def test_a_parameter_of_the_wrong_type_is_not_converted(
    campaign: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], setting: str
) -> None:
    call(capsys, "simulate", campaign, "--out", tmp_path / "field.fits")
    code, _, err = call(capsys, "detect", tmp_path / "field.fits", "--set", setting, "--out", tmp_path / "c.fits")

    assert code == 2
    assert "n_scales: must be a valid integer" in err


def test_the_run_of_another_campaign_is_left_alone(
    campaign: Path, root: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    before = contents(root)
    campaign.write_text(TEXT.replace('"small"', '"other"'))

    for verb in (("plan",), ("run", "--serial")):
        code, out, err = call(capsys, *verb, campaign, "--out", root)
        assert (code, out) == (2, "")
        assert "holds a run of the campaign 'small'" in err
    assert contents(root) == before


@pytest.mark.parametrize("name", ["campaign.toml", "store/tmp/thesis.tex", "runs/2001.jsonl"])
def test_files_of_somebody_else_are_left_alone(
    campaign: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], name: str
) -> None:
    precious = tmp_path / "mine" / name
    precious.parent.mkdir(parents=True)
    precious.write_text("precious")

    assert call(capsys, "run", campaign, "--serial", "--out", tmp_path / "mine")[0] == 2
    assert contents(tmp_path / "mine") == {name: b"precious"}


def test_a_run_whose_campaign_was_edited_is_not_taken_for_the_one_that_was_run(
    campaign: Path, root: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    copy = root / "campaign.toml"
    copy.write_text(copy.read_text().replace("seed = 7", "seed = 8"))

    for arguments in (("verify", root), ("verify", root, "--replay", "2"), ("report", root), ("replay", root)):
        code, out, err = call(capsys, *arguments)
        assert code == 4
        assert "is not what the run was made with" in out + err
    assert call(capsys, "run", campaign, "--serial", "--no-report", "--out", root)[0] == 0
    assert call(capsys, "verify", root, "--replay", "2")[0] == 0


def test_what_a_killed_run_left_over_is_no_damage(root: Path, capsys: pytest.CaptureFixture[str]) -> None:
    manifest = root / "manifest.jsonl"
    manifest.write_bytes(manifest.read_bytes()[:-30])

    code, out, _ = call(capsys, "verify", root)

    assert code == 0
    assert out.count("left over: ") == 1
    assert "0 damaged" in out


def test_a_lost_manifest_is_damage_that_a_repair_makes_good(root: Path, capsys: pytest.CaptureFixture[str]) -> None:
    manifest = root / "manifest.jsonl"
    before = manifest.read_bytes()
    manifest.unlink()

    assert call(capsys, "verify", root)[0] == 4
    assert call(capsys, "verify", root, "--repair", "--serial")[0] == 0
    assert manifest.read_bytes() == before


def test_a_repaired_file_leaves_no_parts_behind(root: Path, capsys: pytest.CaptureFixture[str]) -> None:
    before = contents(root / "store")
    next((root / "store").rglob("links/*/0000004-*.parquet")).write_bytes(b"")

    call(capsys, "verify", root, "--repair", "--serial")

    assert contents(root / "store") == before


def test_plan_says_what_fails_on_the_first_field(
    campaign: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(*arguments: object) -> None:
        raise RuntimeError("no light today")

    monkeypatch.setitem(DETECTORS._entries, "gauss_se", replace(DETECTORS["gauss_se"], detect=fail))
    _, out, _ = call(capsys, "plan", campaign, "--out", tmp_path / "run", "--json")

    (problem,) = json.loads(out)["problems"]
    assert problem.startswith("xmm_epic-soft-10ks / G: ")
    assert "no light today" in problem


@pytest.mark.parametrize(
    "arguments",
    [
        ("replay", "RUN", "--method", "nobody"),
        ("replay", "RUN", "--realisation", "-1"),
        ("status", "RUN\udcff"),
        ("run", "CAMPAIGN", "--serial", "--out", "/proc/survey_mc"),
        ("plan", "CAMPAIGN", "--workers", "0"),
    ],
    ids=lambda arguments: ascii(" ".join(arguments)),
)
def test_odd_arguments_leave_with_2(
    campaign: Path, root: Path, capsys: pytest.CaptureFixture[str], arguments: tuple[str, ...]
) -> None:
    code, out, err = call(capsys, *(a.replace("RUN", str(root)).replace("CAMPAIGN", str(campaign)) for a in arguments))

    assert (code, out) == (2, "")
    assert err


def test_control_characters_do_not_reach_the_terminal(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "bad.toml"
    path.write_text('"a\\n\\u001b[31mb" = 1')
    _, _, err = call(capsys, "validate", path)

    assert "\x1b" not in err
    assert err.count("\n") == 1
