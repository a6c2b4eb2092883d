"""The engine's promise: the same bytes whatever happens, nothing lost, nothing twice."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from small_campaigns import MR1, TEXT, small

from survey_mc.campaign import Campaign
from survey_mc.errors import RunLocked
from survey_mc.run import open_run, run_campaign
from survey_mc.run.executors import ExecutorChoice
from survey_mc.store import Manifest, RunLayout, run_lock
from survey_mc.store.parquet import file_sha256

SERIAL = ExecutorChoice(serial=True)


def data_files(root: Path) -> dict[str, str]:
    """SHA-256 of every data file and of the manifest."""
    layout = RunLayout(root)
    return {path: file_sha256(root / path) for path in [*layout.piece_files(), "manifest.jsonl"]}


def run_serial(campaign: Campaign, root: Path, block: int | None = None) -> dict[str, str]:
    run_campaign(campaign, root, SERIAL, block=block)
    return data_files(root)


@pytest.fixture(scope="module")
def reference(tmp_path_factory: pytest.TempPathFactory) -> dict[str, str]:
    return run_serial(small(extra=MR1), tmp_path_factory.mktemp("reference") / "run")


@pytest.mark.parametrize("block", [1, 3, 64])
def test_files_do_not_depend_on_the_block_size(tmp_path: Path, reference: dict[str, str], block: int) -> None:
    assert run_serial(small(extra=MR1), tmp_path / "run", block) == reference


@pytest.mark.parametrize("workers", [1, 2])
def test_dask_workers_write_the_same_bytes_as_the_serial_executor(
    tmp_path: Path, reference: dict[str, str], workers: int
) -> None:
    run_campaign(small(extra=MR1), tmp_path / "run", ExecutorChoice(workers=workers), block=1)

    assert data_files(tmp_path / "run") == reference


def test_each_shard_ends_as_one_file(reference: dict[str, str]) -> None:
    ranges = sorted({path.rsplit("/", 1)[-1] for path in reference if path.endswith(".parquet")})

    assert ranges == ["0000000-0000004.parquet", "0000004-0000006.parquet"]


def test_a_run_killed_again_and_again_gives_the_same_bytes(tmp_path: Path, reference: dict[str, str]) -> None:
    root, text = tmp_path / "run", tmp_path / "small.toml"
    text.write_text(TEXT + MR1)
    command = [sys.executable, "-c", "from survey_mc.cli import main; main()", "run", str(text), "--serial"]
    command += ["--out", str(root), "--block", "1", "--no-report"]
    kills = 0
    for n_lines in (2, 11, 23):
        process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        while process.poll() is None and _lines(root / "manifest.jsonl") < n_lines:
            time.sleep(0.005)
        if process.poll() is None:
            process.send_signal(signal.SIGKILL)
            kills += 1
        process.wait()
    subprocess.run(command, check=True, capture_output=True)

    assert kills >= 3
    assert data_files(root) == reference
    assert not list((root / "store").rglob("tmp/*"))


def _lines(path: Path) -> int:
    return path.read_bytes().count(b"\n") if path.exists() else 0


def test_a_finished_run_started_again_does_nothing(tmp_path: Path) -> None:
    root = tmp_path / "run"
    before = run_serial(small(), root)
    times = {path: (root / path).stat().st_mtime_ns for path in before if path.endswith(".parquet")}

    again = run_campaign(small(), root, SERIAL)

    assert again.fields == 0
    assert {path: (root / path).stat().st_mtime_ns for path in times} == times


def test_more_realisations_keep_whole_files_and_equal_a_fresh_run(tmp_path: Path) -> None:
    grown = small(("realisations = 6", "realisations = 11"))
    run_serial(small(), tmp_path / "grown")
    first = Path(tmp_path / "grown" / next(p for p in data_files(tmp_path / "grown") if "0000000-0000004" in p))
    written = first.stat().st_mtime_ns

    assert run_serial(grown, tmp_path / "grown") == run_serial(grown, tmp_path / "fresh")
    assert first.stat().st_mtime_ns == written


def test_a_new_method_computes_only_itself(tmp_path: Path) -> None:
    root = tmp_path / "run"
    before = run_serial(small(), root)
    times = {path: (root / path).stat().st_mtime_ns for path in before if path.endswith(".parquet")}
    after = run_serial(small(extra=MR1), root)

    assert before.items() - {("manifest.jsonl", before["manifest.jsonl"])} <= after.items()
    assert {path: (root / path).stat().st_mtime_ns for path in times} == times
    costs = open_run(root).journal()
    assert costs[costs["stage"] == "detect"].groupby("method")["fields"].sum().to_dict() == {"G": 6, "M": 6}


def test_a_new_cell_computes_only_itself_and_equals_a_fresh_run(tmp_path: Path) -> None:
    longer = small(("exposure_ks = [10.0]", "exposure_ks = [10.0, 20.0]"))
    before = run_serial(small(), tmp_path / "run")
    times = {path: (tmp_path / "run" / path).stat().st_mtime_ns for path in before if path.endswith(".parquet")}

    assert run_serial(longer, tmp_path / "run") == run_serial(longer, tmp_path / "fresh")
    assert {path: (tmp_path / "run" / path).stat().st_mtime_ns for path in times} == times
    costs = open_run(tmp_path / "run").journal()
    assert costs[costs["stage"] == "draw"].groupby("cell")["fields"].sum().tolist() == [6, 6]


def test_comments_and_the_order_of_keys_change_no_file(tmp_path: Path) -> None:
    other = small(("n_pix = 128\nfield_of_view = false", "field_of_view = false # all of it\nn_pix = 128"))
    before = run_serial(small(), tmp_path / "run")

    assert run_campaign(other, tmp_path / "run", SERIAL).fields == 0
    assert data_files(tmp_path / "run") == before


def test_methods_that_differ_only_in_their_labels_share_their_files(tmp_path: Path) -> None:
    again = TEXT[TEXT.index("[[method]]") : TEXT.index("[match]")].replace('label = "G"', 'label = "again"')
    alone = run_serial(small(), tmp_path / "alone")

    for block in (1, 3, 6):
        assert run_serial(small(extra=again), tmp_path / f"{block}", block) == alone
    run = open_run(tmp_path / "3")
    assert run.matches("again").drop(columns="method").equals(run.matches("G").drop(columns="method"))
    assert len(run.matches("G")) == len(open_run(tmp_path / "alone").matches("G"))
    assert open_run(tmp_path / "3").journal().query("stage == 'detect'")["fields"].sum() == 6


def test_another_matching_radius_detects_nothing_again_and_equals_a_fresh_run(tmp_path: Path) -> None:
    wider = small(("counts_min = 10", "counts_min = 10\nradius_arcsec = 12.0"))
    run_serial(small(), tmp_path / "run")
    rematched = run_serial(wider, tmp_path / "run")
    fresh = run_serial(wider, tmp_path / "fresh")

    costs = open_run(tmp_path / "run").journal()
    assert costs[costs["stage"] == "detect"]["fields"].sum() == 6
    assert costs[costs["stage"] == "match"]["fields"].sum() == 12
    fresh.pop("manifest.jsonl")
    assert fresh.items() <= rematched.items()


def test_a_second_driver_is_refused_and_a_dead_one_is_no_obstacle(tmp_path: Path) -> None:
    layout = RunLayout(tmp_path / "run")
    with run_lock(layout), pytest.raises(RunLocked, match=f"process {os.getpid()}"):
        run_campaign(small(), layout.root, SERIAL)

    assert run_campaign(small(), layout.root, SERIAL).complete


def test_a_torn_manifest_line_is_made_good(tmp_path: Path) -> None:
    root = tmp_path / "run"
    before = run_serial(small(), root)
    manifest = root / "manifest.jsonl"
    manifest.write_bytes(manifest.read_bytes()[:-40])
    assert len(Manifest(manifest)) == len(before) - 2

    assert run_serial(small(), root) == before


def test_a_killed_worker_costs_nothing(tmp_path: Path, reference: dict[str, str]) -> None:
    root, text = tmp_path / "run", tmp_path / "small.toml"
    text.write_text(TEXT + MR1)
    command = [sys.executable, "-c", "from survey_mc.cli import main; main()", "run", str(text), "--workers", "1"]
    command += ["--out", str(root), "--block", "1", "--no-report"]
    process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    while _lines(root / "manifest.jsonl") < 8:
        time.sleep(0.01)
        assert process.poll() is None
    entries = [json.loads(line) for path in (root / "runs").iterdir() for line in path.read_text().splitlines()]
    os.kill(next(entry["pid"] for entry in entries if entry["event"] == "task"), signal.SIGKILL)

    assert process.wait(timeout=120) == 0
    assert data_files(root) == reference


def test_a_run_killed_before_it_tidied_up_is_tidied_up(tmp_path: Path, reference: dict[str, str]) -> None:
    root = tmp_path / "run"
    run_serial(small(extra=MR1), root)
    lines = (root / "manifest.jsonl").read_text().splitlines(keepends=True)
    (root / "manifest.jsonl").write_text("".join(reversed(lines)))

    assert run_campaign(small(extra=MR1), root, SERIAL).fields == 0
    assert data_files(root) == reference


def test_detections_carry_the_names_of_the_original_program(tmp_path: Path) -> None:
    run_campaign(small(), tmp_path / "run", SERIAL)
    rows = open_run(tmp_path / "run").detections(method="G")
    assert len(rows) > 0
    assert rows["FLUX_AUTO"].equals(rows["counts"])
