"""Random stored fields are computed again from the run directory alone, and must be the same to the last bit."""

from __future__ import annotations

import shutil
import tracemalloc
from dataclasses import replace
from pathlib import Path

import pytest
from damaged_runs import make_run
from small_campaigns import MR1, small

from survey_mc.campaign import expand
from survey_mc.detect import DETECTORS
from survey_mc.run import verify_run
from survey_mc.run.verify.replay import StoredFields, sample
from survey_mc.store import Family, Manifest, Piece, Record, RunLayout, commit_piece, read_stored
from survey_mc.store.files import file_sha256


@pytest.fixture(scope="module")
def finished(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A run whose campaign and sky image are nowhere but in it."""
    folder = tmp_path_factory.mktemp("alone")
    root = make_run(folder, report=False)
    (folder / "damaged.toml").unlink()
    shutil.rmtree(folder / "sky")
    return root


@pytest.fixture
def root(finished: Path, tmp_path: Path) -> Path:
    return Path(shutil.copytree(finished, tmp_path / "run"))


def test_all_fields_of_a_run_come_out_the_same(root: Path) -> None:
    result = verify_run(root, n_replay=100)

    assert result.sound
    assert sorted(result.replayed) == [("xmm_epic-soft-10ks", m, j) for m in "GM" for j in range(6)]


def test_the_seed_chooses_the_fields(root: Path) -> None:
    chosen = {seed: tuple(verify_run(root, n_replay=3, seed=seed).replayed) for seed in (0, 0, 1)}

    assert chosen[0] != chosen[1]
    assert tuple(verify_run(root, n_replay=3).replayed) == chosen[0]


@pytest.mark.parametrize("table", ["truth", "detections", "matches", "links"])
def test_one_changed_number_in_a_sound_file_is_found(root: Path, table: str) -> None:
    """The file is whole and the manifest knows it: only the computation tells."""
    layout = RunLayout(root)
    manifest = Manifest(layout.manifest)
    record = next(r for r in manifest if r.piece.family.table == table and r.rows)
    declared, rows = read_stored(layout, record)
    column = "sep_arcsec" if "sep_arcsec" in rows else "x_pix"
    rows.loc[rows.index[0], column] += 1e-12
    manifest.add([commit_piece(layout, record.piece, declared, rows)])

    result = verify_run(root, n_replay=100)

    assert result.n_damaged == 0
    assert len(result.differences) >= 1
    assert all(f" {table}: computed again gives other rows" in sentence for sentence in result.differences)


def test_a_method_that_fails_now_is_a_sentence(root: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(*arguments: object) -> None:
        raise RuntimeError("no light today")

    monkeypatch.setitem(DETECTORS._entries, "gauss_se", replace(DETECTORS["gauss_se"], detect=fail))
    result = verify_run(root, n_replay=100)

    assert len(result.differences) == 6
    assert all("G / realisation" in sentence and "no light today" in sentence for sentence in result.differences)


def test_without_a_sound_campaign_the_files_are_checked_all_the_same(root: Path) -> None:
    (root / "campaign.lock.json").write_text("{}")
    next((root / "store").rglob("*.parquet")).unlink()

    result = verify_run(root, n_replay=5)

    assert {damage.kind for damage in result.damages} == {"lock", "missing"}
    assert result.replayed == []
    assert "no field can be computed again" in result.differences[0]


def test_fields_are_numbered_cell_by_cell_method_by_method_without_gaps(tmp_path: Path) -> None:
    campaign = small(("realisations = 6", "realisations = 20"), ("[10.0]", "[10.0, 20.0]"), extra=MR1)
    manifest = Manifest(tmp_path / "manifest.jsonl")
    cells = expand(campaign)
    # Cell, method, realisations; the last reach beyond the campaign.
    for cell, method, start, stop in [(0, 0, 0, 4), (0, 0, 6, 8), (1, 1, 16, 24)]:
        family = Family("matches", cells[cell].methods[method].match_key)
        manifest.add([Record(Piece(family, start, stop), "0" * 64, 0, 0, 1)])

    fields = StoredFields(campaign, manifest)
    found = [(cell.index, method.label, j) for cell, method, j in map(fields.__getitem__, range(10))]

    assert len(fields) == 10
    assert found == [(0, "G", j) for j in (0, 1, 2, 3, 6, 7)] + [(1, "M", j) for j in (16, 17, 18, 19)]


def test_a_sample_of_a_million_fields_takes_no_memory_for_them(tmp_path: Path) -> None:
    campaign = small(("realisations = 6", "realisations = 1000000"))
    manifest = Manifest(tmp_path / "manifest.jsonl")
    family = Family("matches", expand(campaign)[0].methods[0].match_key)
    manifest.add(Record(Piece(family, at, at + 10_000), "0" * 64, 0, 0, 1) for at in range(0, 1_000_000, 10_000))

    tracemalloc.start()
    chosen = [realisation for _, _, realisation in sample(campaign, manifest, 50, seed=1)]
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()

    assert len(set(chosen)) == 50
    assert max(chosen) > 900_000
    assert peak < 1_000_000


def test_a_replayed_run_is_only_read(root: Path) -> None:
    before = {path: file_sha256(path) for path in sorted(root.rglob("*")) if path.is_file()}
    verify_run(root, n_replay=4)

    assert {path: file_sha256(path) for path in sorted(root.rglob("*")) if path.is_file()} == before
