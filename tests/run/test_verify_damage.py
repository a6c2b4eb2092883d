"""`verify` finds every flipped bit and every cut, deleted, added, swapped or renamed file of a run directory."""

from __future__ import annotations

import random
import shutil
from collections.abc import Iterator
from pathlib import Path

import pytest
from damaged_runs import call, contents, kind_of_file, make_run, restore

from survey_mc.errors import DamagedStore, SurveyError
from survey_mc.report import build_tables
from survey_mc.run import open_run, verify_run
from survey_mc.store import Manifest, RunData, RunLayout, read_piece

N_FLIPS, N_CUTS = 8, 4  # of each kind of file; the scripts in tests/faults make a thousand


@pytest.fixture(scope="module")
def finished(tmp_path_factory: pytest.TempPathFactory) -> Path:
    root = make_run(tmp_path_factory.mktemp("whole"), report=False)
    build_tables(RunData(root), root)
    return root


@pytest.fixture
def root(finished: Path) -> Iterator[Path]:
    whole = contents(finished)
    yield finished
    shutil.rmtree(finished / "strays", ignore_errors=True)
    restore(finished, whole)


def some(root: Path, chooser: random.Random, n: int) -> list[str]:
    """Files of each kind, n times."""
    kinds: dict[str, list[str]] = {}
    for path, content in sorted(contents(root).items()):
        if content:
            kinds.setdefault(kind_of_file(path), []).append(path)
    return [chooser.choice(paths) for paths in kinds.values() for _ in range(n)]


def test_the_check_of_a_run_covers_every_kind_of_file(root: Path) -> None:
    assert {kind_of_file(path) for path in contents(root)} == {
        "campaign", "input", "journal", "list of tables", "lock", "manifest", "stored file", "table"
    }  # fmt: skip


def test_every_flipped_bit_is_reported_and_no_row_of_its_file_is_read(root: Path) -> None:
    chooser = random.Random(21)
    records = {record.piece.path: record for record in Manifest(root / "manifest.jsonl")}
    for path in some(root, chooser, N_FLIPS):
        whole = (root / path).read_bytes()
        byte, bit = chooser.randrange(len(whole)), chooser.randrange(8)
        (root / path).write_bytes(whole[:byte] + bytes([whole[byte] ^ 1 << bit]) + whole[byte + 1 :])

        assert verify_run(root).n_damaged, (path, byte, bit)
        if path in records:
            with pytest.raises(DamagedStore):
                read_piece(RunLayout(root), records[path])
        elif kind_of_file(path) in ("lock", "manifest"):
            with pytest.raises(SurveyError):
                open_run(root)
        (root / path).write_bytes(whole)


def test_every_cut_file_is_an_answer_with_its_name(root: Path) -> None:
    chooser = random.Random(22)
    for path in some(root, chooser, N_CUTS):
        whole = (root / path).read_bytes()
        (root / path).write_bytes(whole[: chooser.randrange(len(whole))])

        code, said = call("verify", root)
        if kind_of_file(path) == "manifest":
            assert code == 4 or "left over" in said
        elif kind_of_file(path) != "journal":
            assert code == 4
            assert path in said
        assert call("status", root)[0] in (0, 2, 4)
        (root / path).write_bytes(whole)


@pytest.mark.parametrize("pattern", ["truth", "links", "matches"])
def test_deleted_added_swapped_and_renamed_files_are_found(root: Path, pattern: str) -> None:
    first, second, *_ = sorted((root / "store").rglob(f"{pattern}/*/*.parquet"))
    one, other = first.read_bytes(), second.read_bytes()

    def found() -> set[tuple[str, str]]:
        return {(damage.kind, Path(damage.path).name) for damage in verify_run(root).damages}

    first.unlink()
    assert found() == {("missing", first.name)}
    first.write_bytes(other)
    second.write_bytes(one)
    assert {name for _, name in found()} == {first.name, second.name}
    first.write_bytes(one)
    second.write_bytes(other)
    second.rename(second.with_name("0000009-0000011.parquet"))
    assert found() == {("missing", second.name), ("leftover", "0000009-0000011.parquet")}
    second.with_name("0000009-0000011.parquet").rename(second)
    shutil.copy(first, first.with_name("copy.parquet"))
    assert found() == {("extra", "copy.parquet")}
    first.with_name("copy.parquet").unlink()
    assert found() == set()


def test_every_stored_file_is_read_once_and_named_before(root: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    named: list[str] = []
    read: list[str] = []
    real = Path.read_bytes

    def counted(path: Path) -> bytes:
        read.append(path.name if path.suffix != ".parquet" else path.relative_to(root).as_posix())
        return real(path)

    monkeypatch.setattr(Path, "read_bytes", counted)
    verify_run(root, on_file=named.append)

    stored = [record.piece.path for record in Manifest(root / "manifest.jsonl")]
    assert named == stored
    assert sorted(path for path in read if path.startswith("store/")) == sorted(stored)


def test_what_a_run_has_packed_meanwhile_is_no_damage(root: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Between reading the manifest and reading the files, another process drops a file and enters one."""
    from survey_mc.store import verify

    manifest = Manifest(root / "manifest.jsonl")
    piece = next(iter(manifest)).piece
    real = verify.verify_store

    def meanwhile(*arguments: object) -> object:
        if piece in manifest:
            manifest.drop([piece])
            (root / piece.path).unlink()
        return real(*arguments)  # type: ignore[arg-type]

    monkeypatch.setattr(verify, "verify_store", meanwhile)

    assert not verify_run(root).damages
