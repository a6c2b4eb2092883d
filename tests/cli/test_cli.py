"""The command line: answers on stdout, one sentence and the right exit code for everything that is wrong."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from astropy.io import fits
from small_campaigns import MR1, TEXT

from survey_mc.cli import main, progress
from survey_mc.detect import DETECTORS
from survey_mc.fits import read_catalogue, read_counts_image
from survey_mc.run import simulate_field
from survey_mc.store import RunLayout, run_lock


def call(capsys: pytest.CaptureFixture[str], *arguments: object) -> tuple[int, str, str]:
    """Exit code, stdout and stderr of a command."""
    with pytest.raises(SystemExit) as left:
        main([str(argument) for argument in arguments])
    captured = capsys.readouterr()
    assert "Traceback" not in captured.err
    return int(left.value.code or 0), captured.out, captured.err


@pytest.fixture
def campaign(tmp_path: Path) -> Path:
    path = tmp_path / "small.toml"
    path.write_text(TEXT + MR1)
    return path


@pytest.fixture(scope="module")
def finished(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("finished")
    (folder / "small.toml").write_text(TEXT + MR1)
    with pytest.raises(SystemExit) as left:
        main(["run", str(folder / "small.toml"), "--serial", "--out", str(folder / "run"), "--no-report"])
    assert left.value.code == 0
    return folder / "run"


@pytest.fixture
def image(campaign: Path, tmp_path: Path) -> Path:
    path = tmp_path / "field.fits"
    with pytest.raises(SystemExit):
        main(["simulate", str(campaign), "--realisation", "1", "--out", str(path)])
    return path


def test_validate_prints_the_cells_and_touches_nothing(
    campaign: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    code, out, _ = call(capsys, "validate", campaign)

    assert code == 0
    assert "xmm_epic-soft-10ks" in out
    assert [path.name for path in tmp_path.iterdir()] == ["small.toml"]


def test_a_bad_campaign_leaves_with_2_one_sentence_and_nothing_written(
    campaign: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    campaign.write_text(TEXT.replace("[10.0]", "[-1.0]"))
    for verb in ("validate", "plan", "run"):
        options = () if verb == "validate" else ("--out", tmp_path / "out")
        code, out, err = call(capsys, verb, campaign, *options)
        assert (code, out) == (2, "")
        assert err.count("\n") == 1
        assert "small.toml: grid.exposure_ks[0]" in err
    assert [path.name for path in tmp_path.iterdir()] == ["small.toml"]


@pytest.mark.parametrize(
    "arguments",
    [
        ("run",),
        ("fly",),
        ("run", "CAMPAIGN", "--workers", "0", "--out", "OUT"),
        ("run", "CAMPAIGN", "--workers", "2", "--serial", "--out", "OUT"),
        ("run", "CAMPAIGN", "--block", "0", "--out", "OUT"),
        ("run", "CAMPAIGN", "--scheduler-file", "OUT", "--out", "OUT"),
        ("run", "CAMPAIGN", "--scheduler", "nonsense", "--out", "OUT"),
        ("simulate", "CAMPAIGN", "--cell", "3", "--out", "OUT"),
        ("simulate", "CAMPAIGN", "--realisation", "-1", "--out", "OUT"),
        ("status", "OUT"),
        ("report", "OUT"),
        ("verify", "OUT"),
        ("replay", "OUT"),
        ("show", "nothing"),
        ("check-detector",),
        ("detect", "OUT", "--out", "OUT"),
    ],
    ids=" ".join,
)
def test_wrong_usage_leaves_with_2_and_writes_nothing(
    campaign: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], arguments: tuple[str, ...]
) -> None:
    names = {"CAMPAIGN": str(campaign), "OUT": str(tmp_path / "nowhere")}
    code, out, err = call(capsys, *(names.get(a, a) for a in arguments))

    assert (code, out) == (2, "")
    assert err
    assert not (tmp_path / "nowhere" / "store").exists()


def test_plan_tells_what_is_to_do_and_what_it_costs(
    campaign: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    code, out, _ = call(capsys, "plan", campaign, "--out", tmp_path / "run", "--json")
    planned = json.loads(out)

    assert code == 0
    assert (planned["fields"], planned["to_do"], planned["files"]) == (6, 6, 14)
    assert 0.0 < planned["cpu_s"] < 60.0
    assert planned["bytes"] > 1000
    assert not (tmp_path / "run").exists()


def test_plan_of_a_finished_run_has_nothing_to_do(finished: Path, capsys: pytest.CaptureFixture[str]) -> None:
    _, out, _ = call(capsys, "plan", finished / "campaign.toml", "--out", finished, "--json")

    assert json.loads(out)["to_do"] == 0


def test_status_and_verify_of_a_sound_run(finished: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert "12 of 12" in call(capsys, "status", finished)[1]
    code, out, _ = call(capsys, "verify", finished, "--replay", "3")
    assert code == 0
    assert "14 files checked, 0 damaged; 3 fields computed again, 0 tables differ" in out


def test_verify_tells_on_stderr_how_far_it_is(
    finished: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(progress, "SECONDS_BETWEEN_LINES", 0.0)
    code, out, err = call(capsys, "verify", finished)
    n_files = sum(1 for _ in RunLayout(finished).piece_files())
    assert code == 0
    assert out.startswith(f"{n_files} files checked, 0 damaged")
    assert [line.split(", ")[0] for line in err.splitlines()] == [f"{finished}: {n} files done" for n in range(n_files)]


def test_verify_finds_and_repairs_damage(campaign: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    root = tmp_path / "run"
    call(capsys, "run", campaign, "--serial", "--out", root, "--no-report")
    files = {path: path.read_bytes() for path in (root / "store").rglob("*.parquet")}
    changed, gone, *_ = sorted(files)
    changed.write_bytes(files[changed][:-9] + b"x" + files[changed][-8:])
    gone.unlink()
    (changed.parent / "stray.txt").write_text("not ours")

    code, out, _ = call(capsys, "verify", root, "--json")
    assert code == 4
    assert sorted(d["kind"] for d in json.loads(out)["damages"]) == ["changed", "extra", "missing"]
    assert call(capsys, "verify", root, "--repair", "--serial")[0] == 0
    assert {path: path.read_bytes() for path in (root / "store").rglob("*.parquet")} == files
    assert call(capsys, "verify", root)[0] == 0


def test_a_locked_run_directory_leaves_with_5(
    campaign: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with run_lock(RunLayout(tmp_path / "run")):
        code, _, err = call(capsys, "run", campaign, "--serial", "--out", tmp_path / "run")

    assert code == 5
    assert "is writing to this run directory" in err


def test_replay_does_one_field_again(finished: Path, capsys: pytest.CaptureFixture[str]) -> None:
    code, out, _ = call(capsys, "replay", finished, "--realisation", "2", "--method", "M")

    assert code == 0
    assert "realisation 2" in out


def test_simulate_writes_the_field_of_the_run(campaign: Path, image: Path) -> None:
    field = simulate_field(campaign, 0, 1)

    np.testing.assert_array_equal(read_counts_image(image).counts, field.observation.counts)
    with fits.open(image) as units:
        assert [unit.name for unit in units] == ["COUNTS", "EXPOSURE", "BACKGROUND", "PHOTONS", "TRUTH"]
        assert len(units["TRUTH"].data) == len(field.truth)


@pytest.mark.parametrize("method", ["gauss_se", "mr1_se"])
def test_detect_writes_a_catalogue_and_regions(
    image: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], method: str
) -> None:
    catalogue = tmp_path / "cat.fits"
    code, out, _ = call(
        capsys,
        "detect",
        image,
        "--method",
        method,
        "--exposure",
        image,
        "--flux-per-rate",
        "6.7e-13",
        "--out",
        catalogue,
    )
    rows = read_catalogue(catalogue).detections

    assert code == 0
    assert f"{len(rows)} detections" in out
    assert len(rows) > 0
    assert {"RA", "DEC", "RADEC_ERR", "x_pix", "X_IMAGE", "counts", "counts_err", "r50_arcsec", "flux_cgs"} <= set(rows)
    assert rows["flux_cgs"].notna().all()
    assert (tmp_path / "cat.reg").read_text().count("ellipse") == len(rows)
    assert call(capsys, "detect", image, "--out", catalogue)[0] == 2


@pytest.mark.parametrize(
    ("options", "cause"),
    [
        (("--method", "mr1"), "mr1_se"),
        (("--set", "significanse=1e-3"), "significance"),
        (("--set", "significance=2"), "significance"),
        (("--set", "significance"), "key=value"),
        (("--set", "n_scales=11"), "n_scales"),
        (("--profile", "papr"), "paper"),
        (("--exposure", "gone.fits"), "gone.fits"),
        (("--psf-fwhm", "-1"), "PSF"),
        (("--exposure-s", "-1"), "exposure"),
        (("--pixel-scale", "9"), "pixel scale"),
    ],
    ids=lambda value: " ".join(value) if isinstance(value, tuple) else "",
)
def test_a_bad_option_of_detect_is_one_sentence(
    image: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], options: tuple[str, ...], cause: str
) -> None:
    code, out, err = call(capsys, "detect", image, *options, "--out", tmp_path / "cat.fits")

    assert (code, out) == (2, "")
    assert cause in err.splitlines()[-1]
    assert not (tmp_path / "cat.fits").exists()


@pytest.mark.parametrize("topic", ["methods", "instruments", "skies", "relations", "schema"])
def test_show_lists_what_there_is(capsys: pytest.CaptureFixture[str], topic: str) -> None:
    code, out, _ = call(capsys, "show", topic, "--json")

    assert code == 0
    assert len(json.loads(out)) >= 1


def test_show_methods_tells_all_there_is_to_choose(capsys: pytest.CaptureFixture[str]) -> None:
    lines = call(capsys, "show", "methods")[1].splitlines()
    shown = json.loads(call(capsys, "show", "methods", "--json")[1])

    assert set(shown) == {detector.name for detector in DETECTORS}
    for name, entry in shown.items():
        detector = DETECTORS[name]
        assert (entry["label"], entry["version"]) == (detector.label, detector.version)
        assert entry["reference"] == detector.reference
        assert f"{name}: {detector.label}, version {detector.version}: {detector.about}" in lines
        assert f"    reference: {detector.reference}" in lines
        assert {p["name"] for p in entry["parameters"]} == set(detector.params.model_fields)
        assert all(p["about"] for p in entry["parameters"])
        assert entry["profiles"]["paper"] == detector.profiles["paper"].model_dump(mode="json")
    assert "    profile paper_clusters: minarea_pix = 16, fwhm_arcsec = 20.0" in lines


def test_show_columns_tells_the_own_and_the_native_columns_of_every_procedure(
    capsys: pytest.CaptureFixture[str],
) -> None:
    code, out, _ = call(capsys, "show", "columns")
    shown = json.loads(call(capsys, "show", "columns", "--json")[1])

    assert code == 0
    assert "    FLUX_AUTO (float64, count): counts: source counts measured by the procedure" in out.splitlines()
    for detector in DETECTORS:
        own = shown[f"detections of {detector.name}, further columns"]["columns"]
        assert [column["name"] for column in own] == [column.name for column in detector.extra_columns]
        if detector.native_names:
            native = shown[f"detections of {detector.name} in a FITS catalogue, further names"]["columns"]
            assert [column["name"] for column in native] == list(detector.native_names)


def test_the_schema_describes_the_campaigns_of_the_project(capsys: pytest.CaptureFixture[str]) -> None:
    schema = json.loads(call(capsys, "show", "schema")[1])

    assert schema["$schema"].endswith("2020-12/schema")
    assert "fwhm_arcsec" in schema["$defs"]["params_gauss_se"]["properties"]
