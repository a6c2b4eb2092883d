"""The store keeps whole, named, checked files, and notices every change to them."""

from __future__ import annotations

import random
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from survey_mc.columns import LINKS, MATCHES, Column, Table
from survey_mc.errors import BadInput, DamagedStore
from survey_mc.store import Family, Manifest, Piece, Record, RunData, RunLayout, commit_piece, read_piece, verify_store
from survey_mc.store.parquet import piece_table, read_frame, write_frame
from survey_mc.store.sealed_text import opened, seal

N_FLIPS = 150


def links(n: int = 50) -> pd.DataFrame:
    columns = {c.name: np.arange(n).astype(c.dtype) for c in LINKS.columns}
    return pd.DataFrame(columns)


@pytest.fixture
def layout(tmp_path: Path) -> RunLayout:
    return RunLayout(tmp_path)


def store_one(layout: RunLayout, start: int = 0, stop: int = 4, frame: pd.DataFrame | None = None) -> Record:
    piece = Piece(Family("links", "0123456789abcdef" * 2), start, stop)
    record = commit_piece(layout, piece, LINKS, links() if frame is None else frame)
    Manifest(layout.manifest).add([record])
    return record


def damages(layout: RunLayout) -> list[str]:
    return [damage.kind for damage in verify_store(layout, Manifest(layout.manifest))]


def test_rows_come_back_as_they_went_in(layout: RunLayout) -> None:
    pd.testing.assert_frame_equal(read_piece(layout, store_one(layout)), links())


def test_no_rows_keep_the_whole_schema(layout: RunLayout) -> None:
    frame = pd.DataFrame({c.name: pd.Series([], dtype=object) for c in MATCHES.columns})
    piece = Piece(Family("matches", "0" * 32), 0, 1)
    record = commit_piece(layout, piece, MATCHES, frame)

    assert piece_table(layout, piece) == MATCHES
    assert str(read_piece(layout, record)["sep_arcsec"].dtype) == "float64"


def test_unit_ucd_and_meaning_travel_with_the_file(layout: RunLayout) -> None:
    assert piece_table(layout, store_one(layout).piece) == LINKS


def test_written_twice_the_bytes_are_the_same(layout: RunLayout) -> None:
    first = store_one(layout)
    before = (layout.root / first.piece.path).read_bytes()

    assert store_one(layout) == first
    assert (layout.root / first.piece.path).read_bytes() == before


def test_a_missing_column_is_refused(layout: RunLayout) -> None:
    with pytest.raises(ValueError, match="n_photons"):
        store_one(layout, frame=links().drop(columns="n_photons"))

    assert not list(layout.root.rglob("*.parquet"))


def test_every_flipped_bit_is_found(layout: RunLayout) -> None:
    record = store_one(layout)
    path = layout.root / record.piece.path
    whole = path.read_bytes()
    chooser = random.Random(5)
    for _ in range(N_FLIPS):
        place, bit = chooser.randrange(len(whole)), chooser.randrange(8)
        path.write_bytes(whole[:place] + bytes([whole[place] ^ 1 << bit]) + whole[place + 1 :])
        assert damages(layout) == ["changed"]


def test_a_damaged_file_is_never_read_silently(layout: RunLayout) -> None:
    record = store_one(layout)
    path = layout.root / record.piece.path
    whole = path.read_bytes()
    chooser = random.Random(6)
    for _ in range(N_FLIPS):
        place = chooser.randrange(len(whole))
        path.write_bytes(whole[:place] + bytes([whole[place] ^ 16]) + whole[place + 1 :])
        with pytest.raises(DamagedStore, match="has changed"):
            read_piece(layout, record)


@pytest.mark.parametrize("size", [0, 1, 4, 100, -5])
def test_a_truncated_file_is_found_and_not_read(layout: RunLayout, size: int) -> None:
    record = store_one(layout)
    path = layout.root / record.piece.path
    path.write_bytes(path.read_bytes()[:size])

    assert damages(layout) == ["changed"]
    with pytest.raises(DamagedStore, match="--repair"):
        read_piece(layout, record)


def test_deleted_extra_and_swapped_files_are_found(layout: RunLayout) -> None:
    first = layout.root / store_one(layout, 0, 4).piece.path
    second = layout.root / store_one(layout, 4, 8, links(60)).piece.path
    (first.parent / "0000008-0000012.parquet").write_bytes(first.read_bytes())
    assert damages(layout) == ["leftover"]
    (first.parent / "mine.txt").write_text("")
    assert damages(layout) == ["leftover", "extra"]
    (first.parent / "mine.txt").unlink()
    (first.parent / "0000008-0000012.parquet").unlink()

    content = first.read_bytes()
    first.write_bytes(second.read_bytes())
    second.write_bytes(content)
    assert damages(layout) == ["changed", "changed"]

    first.unlink()
    assert damages(layout) == ["missing", "changed"]


def test_a_manifest_cannot_point_outside_the_store(layout: RunLayout) -> None:
    store_one(layout)
    (line,) = layout.manifest.read_bytes().splitlines()
    outside = (opened(line) or b"").decode().replace("store/v1/links", "store/v1/../../links")
    layout.manifest.write_text(seal(outside) + "\n")

    with pytest.raises(DamagedStore, match="outside the store"):
        Manifest(layout.manifest)


@pytest.mark.parametrize("cut", [1, 10, 60])
def test_a_torn_last_line_is_left_out_and_does_not_swallow_the_next(layout: RunLayout, cut: int) -> None:
    store_one(layout, 0, 4)
    store_one(layout, 4, 8)
    layout.manifest.write_bytes(layout.manifest.read_bytes()[:-cut])
    if cut > 1:
        assert [r.piece.start for r in Manifest(layout.manifest)] == [0]
    store_one(layout, 8, 12)

    assert [r.piece.start for r in Manifest(layout.manifest)][-1] == 8


def test_a_part_inside_a_larger_file_does_not_count_twice(layout: RunLayout) -> None:
    for start, stop in ((0, 2), (2, 4), (0, 4), (4, 6)):
        store_one(layout, start, stop)
    manifest = Manifest(layout.manifest)

    assert [(r.piece.start, r.piece.stop) for r in manifest] == [(0, 4), (4, 6)]
    assert [(p.start, p.stop) for p in manifest.superseded()] == [(0, 2), (2, 4)]


def test_a_compacted_manifest_does_not_remember_the_order_of_work(tmp_path: Path) -> None:
    texts = []
    for name, order in (("a", ((0, 4), (4, 8))), ("b", ((4, 8), (0, 4)))):
        layout = RunLayout(tmp_path / name)
        for start, stop in order:
            store_one(layout, start, stop)
        Manifest(layout.manifest).compact()
        texts.append(layout.manifest.read_text())

    assert texts[0] == texts[1]


def test_an_aggregated_table_comes_back_with_its_units(tmp_path: Path) -> None:
    table = Table("t", "a table", (Column("x_arcsec", "float64", "offset", "arcsec"), Column("name", "string", "name")))
    frame = pd.DataFrame({"x_arcsec": [1.0, np.nan], "name": ["a", "β"]})
    write_frame(tmp_path / "t.parquet", table, frame)

    assert read_frame(tmp_path / "t.parquet")["name"].tolist() == ["a", "β"]
    assert sorted(p.name for p in tmp_path.iterdir()) == ["t.parquet"]


@pytest.mark.parametrize("content", [None, "", "{", "[]", '{"lock_schema": 1}', "{}"])
def test_what_is_no_run_directory_is_refused(tmp_path: Path, content: str | None) -> None:
    if content is not None:
        (tmp_path / "campaign.lock.json").write_text(content)

    with pytest.raises(BadInput, match=str(tmp_path)):
        RunData(tmp_path)
