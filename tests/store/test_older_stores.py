"""Every store that a version of this package wrote opens, is whole, and can be brought up to date without a loss."""

from __future__ import annotations

from pathlib import Path

import pytest
from older_runs import FIXTURES, VERSIONS, older_run

from survey_mc.errors import BadInput
from survey_mc.lock_form import LOCK_SCHEMA, lock_digest, lock_text
from survey_mc.run import open_run, verify_run
from survey_mc.store import RunData, RunLayout, migrate_run
from survey_mc.store.files import file_sha256
from survey_mc.store.lock_file import read_lock

# What the versions stored of three fields with one source or so in each.
N_TRUTH, N_DETECTIONS, N_MATCHES = 4, 4, 8
OBSERVED_DEG2 = 64 * 64 * (4.0 / 3600.0) ** 2  # the image is smaller than the region


@pytest.fixture(params=VERSIONS)
def root(request: pytest.FixtureRequest, tmp_path: Path) -> Path:
    return older_run(request.param, tmp_path)


def test_what_an_older_version_stored_is_read(root: Path) -> None:
    run = open_run(root)

    assert (len(run.truth()), len(run.detections()), len(run.matches())) == (N_TRUTH, N_DETECTIONS, N_MATCHES)
    assert run.data.cells[0].region_deg2 == pytest.approx(OBSERVED_DEG2, rel=1e-12)
    assert run.journal()["fields"].sum() > 0


def test_what_an_older_version_stored_is_whole(root: Path) -> None:
    result = verify_run(root)

    assert result.sound
    assert not result.damages


def test_a_migration_gives_an_older_run_todays_checks_and_leaves_its_rows_alone(root: Path) -> None:
    files = {path: file_sha256(root / path) for path in RunLayout(root).piece_files()}
    rows = open_run(root).matches().to_csv()

    migrate_run(root)

    assert {path: file_sha256(root / path) for path in RunLayout(root).piece_files()} == files
    assert open_run(root).matches().to_csv() == rows
    lock = read_lock(root / "campaign.lock.json")
    assert (lock["lock_schema"], lock["digest"]) == (LOCK_SCHEMA, lock_digest(lock))
    assert all(b'"crc": ' in line for line in (root / "manifest.jsonl").read_bytes().splitlines())
    assert verify_run(root).sound
    assert not migrate_run(root).lock


def test_a_later_version_is_refused_with_both_numbers(tmp_path: Path) -> None:
    root = older_run("present", tmp_path)
    lock = RunData(root).lock
    later = {name: value for name, value in lock.items() if name != "digest"} | {"lock_schema": LOCK_SCHEMA + 1}
    (root / "campaign.lock.json").write_text(lock_text(later | {"digest": lock_digest(later)}))
    wanted = f"lock_schema {LOCK_SCHEMA + 1}, this survey_mc reads {LOCK_SCHEMA}"

    for read in (open_run, verify_run, migrate_run):
        with pytest.raises(BadInput, match=wanted):
            read(root)


def test_a_later_manifest_and_a_later_store_are_refused_with_both_numbers(tmp_path: Path) -> None:
    root = older_run("present", tmp_path)
    manifest = root / "manifest.jsonl"
    whole = manifest.read_text()

    manifest.write_text('{"manifest_version": 2, "more": "of it"}\n' + whole)
    for read in (open_run, verify_run, migrate_run):
        with pytest.raises(BadInput, match="has version 2, this survey_mc reads 1"):
            read(root)

    plain = (FIXTURES / "without_checksums" / "manifest.jsonl").read_text()
    manifest.write_text(plain.replace("/v1/", "/v2/"))
    (root / "store" / "v2").mkdir()
    for read in (open_run, verify_run, migrate_run):
        with pytest.raises(BadInput, match="store version v2, this survey_mc reads v1"):
            read(root)
