"""Stored tables may change: what an older version wrote is read as today's, and a migration writes that down."""

from __future__ import annotations

import io
from pathlib import Path

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from older_runs import older_run

from survey_mc.columns import DETECTIONS, LINKS, Column, Table
from survey_mc.errors import BadInput, DamagedStore
from survey_mc.run import open_run, verify_run
from survey_mc.run.pack import pack_shard
from survey_mc.store import (
    Family,
    Manifest,
    Piece,
    Record,
    RunLayout,
    commit_piece,
    migrate_run,
    read_piece,
    read_stored,
    replacement,
    upgrades,
)
from survey_mc.store.files import file_sha256
from survey_mc.store.parquet import piece_table
from survey_mc.store.upgrades import Step

KEY = "0123456789abcdef" * 2
# Tomorrow's links: `sep_arcsec` was called `separation`, photons have become fractions, `in_list` was never filled, and
# `weight` is new.
TOMORROW = Table(
    "links",
    "links of tomorrow",
    (
        *LINKS.columns[:4],
        Column("n_photons", "float64", "photons, weighted", "count"),
        LINKS.columns[5],
        Column("weight", "float64", "weight of the pair"),
    ),
    version=2,
)


def to_tomorrow(rows: pd.DataFrame) -> pd.DataFrame:
    return rows.rename(columns={"separation": "sep_arcsec"}).assign(in_list=False, weight=1.0)


@pytest.fixture
def tomorrow(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(upgrades.PRESENT, "links", TOMORROW)
    monkeypatch.setattr(upgrades, "STEPS", (Step("links", 1, "weights", to_tomorrow),))


def write_old(layout: RunLayout, start: int, stop: int) -> Record:
    """A file of the links as they were, with a column that has no type."""
    n = stop - start
    old = pa.table(
        {
            "realisation": pa.array(range(start, stop), pa.int32()),
            "det_id": pa.array(range(n), pa.int32()),
            "source_id": pa.array(range(n), pa.int32()),
            "separation": pa.array(np.arange(n) + 0.5),
            "n_photons": pa.array([2**24 + 1] * n, pa.int32()),
            "in_list": pa.nulls(n),
        }
    ).replace_schema_metadata({"table": "links", "about": "links of old", "schema_version": "1"})
    piece = Piece(Family("links", KEY), start, stop)
    path = layout.root / piece.path
    path.parent.mkdir(parents=True, exist_ok=True)
    pq.write_table(old, path, write_page_checksum=True)
    return Record(piece, file_sha256(path), n, path.stat().st_size, 1)


def test_rows_of_an_older_version_are_read_as_todays(tomorrow: None, tmp_path: Path) -> None:
    rows = read_piece(RunLayout(tmp_path), write_old(RunLayout(tmp_path), 0, 3))

    assert list(rows.columns) == list(TOMORROW.names)
    assert {name: str(kind) for name, kind in rows.dtypes.items()} == {c.name: c.dtype for c in TOMORROW.columns}
    assert rows["sep_arcsec"].tolist() == [0.5, 1.5, 2.5]
    assert rows["n_photons"].tolist() == [2.0**24 + 1] * 3
    assert rows["weight"].tolist() == [1.0] * 3


def test_some_columns_of_an_older_version_are_those_asked_for(tomorrow: None, tmp_path: Path) -> None:
    record = write_old(RunLayout(tmp_path), 0, 3)

    assert list(read_piece(RunLayout(tmp_path), record, ["weight", "sep_arcsec"]).columns) == ["weight", "sep_arcsec"]


def test_parts_of_two_versions_are_packed_into_a_file_of_today(tomorrow: None, tmp_path: Path) -> None:
    layout = RunLayout(tmp_path)
    manifest = Manifest(layout.manifest)
    old = write_old(layout, 0, 2)
    new = commit_piece(
        layout, Piece(old.piece.family, 2, 4), TOMORROW, read_piece(layout, old).assign(realisation=[2, 3])
    )
    manifest.add([old, new])

    pack_shard(layout, manifest, old.piece.family, (0, 4), only_whole=True)

    (whole,) = manifest
    assert (whole.piece.stop, whole.schema_version, whole.rows) == (4, 2, 4)
    assert piece_table(layout, whole.piece) == TOMORROW
    assert read_piece(layout, whole)["realisation"].tolist() == [0, 1, 2, 3]


def test_a_later_version_of_a_table_is_refused_with_both_numbers(tmp_path: Path) -> None:
    layout = RunLayout(tmp_path)
    later = Table("links", "later", LINKS.columns, version=3)
    frame = pd.DataFrame({c.name: np.zeros(1).astype(c.dtype) for c in LINKS.columns})
    record = commit_piece(layout, Piece(Family("links", KEY), 0, 1), later, frame)

    with pytest.raises(BadInput, match="table 'links' has version 3, this survey_mc reads 1"):
        read_piece(layout, record)


def test_a_version_without_a_way_up_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(upgrades.PRESENT, "links", TOMORROW)

    with pytest.raises(BadInput, match="version 1, and no way leads from 1"):
        read_piece(RunLayout(tmp_path), write_old(RunLayout(tmp_path), 0, 1))


def test_a_step_that_would_lose_a_value_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    whole = Table(
        "links", "whole arcseconds", (*LINKS.columns[:3], Column("sep_arcsec", "int32", "rounded")), version=2
    )
    monkeypatch.setitem(upgrades.PRESENT, "links", whole)
    step = Step("links", 1, "rounding", lambda rows: rows.rename(columns={"separation": "sep_arcsec"}))
    monkeypatch.setattr(upgrades, "STEPS", (step,))

    with pytest.raises(BadInput, match=r"links\.sep_arcsec has values that do not fit into int32"):
        read_piece(RunLayout(tmp_path), write_old(RunLayout(tmp_path), 0, 2))


def test_the_own_columns_of_a_method_come_through_a_step_with_their_units(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    layout = RunLayout(tmp_path)
    own = Column("DET_ML", "float64", "likelihood", "nat", "stat.likelihood")
    stored = DETECTIONS.with_columns((own,))
    frame = pd.DataFrame({c.name: np.ones(2).astype(c.dtype) for c in stored.columns})
    record = commit_piece(layout, Piece(Family("detections", KEY), 0, 2), stored, frame)
    more = Table("detections", "more", (*DETECTIONS.columns, Column("extra", "int32", "new")), version=2)
    monkeypatch.setitem(upgrades.PRESENT, "detections", more)
    monkeypatch.setattr(upgrades, "STEPS", (Step("detections", 1, "extra", lambda rows: rows.assign(extra=7)),))

    table, rows = read_stored(layout, record)

    assert table == more.with_columns((own,))
    assert rows["DET_ML"].tolist() == [1.0, 1.0]


def test_a_stored_file_without_its_declared_columns_is_not_read(tmp_path: Path) -> None:
    with pytest.raises(DamagedStore, match="does not have the columns of table 'links'"):
        read_piece(RunLayout(tmp_path), write_old(RunLayout(tmp_path), 0, 2))


@pytest.fixture
def grown(monkeypatch: pytest.MonkeyPatch) -> None:
    """A version in which links and matches have one more column."""
    for name in ("links", "matches"):
        today = upgrades.PRESENT[name]
        column = Column("weight", "float64", "weight of the pair")
        monkeypatch.setitem(upgrades.PRESENT, name, Table(name, today.about, (*today.columns, column), version=2))
    steps = [Step(name, 1, "weights", lambda rows: rows.assign(weight=1.0)) for name in ("links", "matches")]
    monkeypatch.setattr(upgrades, "STEPS", tuple(steps))


def all_rows(root: Path) -> list[str]:
    run = open_run(root)
    return [frame.to_csv() for frame in (run.truth(), run.detections(), run.matches(), run.links())]


def test_a_run_of_an_older_version_is_read_verified_and_migrated_without_a_loss(grown: None, tmp_path: Path) -> None:
    root = older_run("present", tmp_path)
    before = all_rows(root)
    assert verify_run(root).sound

    done = migrate_run(root)

    assert (done.files, done.rewritten) == (4, 2)
    assert all_rows(root) == before
    assert {r.piece.family.table: r.schema_version for r in Manifest(root / "manifest.jsonl")} == {
        "truth": 1,
        "detections": 1,
        "matches": 2,
        "links": 2,
    }
    assert verify_run(root).sound
    assert migrate_run(root).rewritten == 0
    assert "weight" in pd.read_csv(io.StringIO(before[2])).columns


@pytest.mark.parametrize("steps", range(6))
def test_a_killed_migration_is_finished_by_whoever_writes_next(
    grown: None, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, steps: int
) -> None:
    root = older_run("present", tmp_path)
    before = all_rows(root)
    left = iter([None] * steps)

    def dying(real):
        def step(*arguments, **named):
            if next(left, "dead") == "dead":
                raise KeyboardInterrupt
            return real(*arguments, **named)

        return step

    with monkeypatch.context() as patch:
        patch.setattr(Manifest, "add", dying(Manifest.add))
        patch.setattr(replacement, "_put_in_place", dying(replacement._put_in_place))
        patch.setattr(Manifest, "compact", dying(Manifest.compact))
        if steps < 5:
            with pytest.raises(KeyboardInterrupt):
                migrate_run(root)
        else:
            migrate_run(root)

    mended = verify_run(root, repair=True)

    assert mended.repaired is None  # nothing had to be computed
    assert all_rows(root) == before
    assert migrate_run(root).rewritten == (0 if steps >= 3 else 1 if steps else 2)
    assert verify_run(root).sound
    assert not list((root / "store" / "tmp").iterdir())
