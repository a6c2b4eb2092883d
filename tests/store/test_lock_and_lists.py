"""The lock file, the list of tables and the folders of a run: what was changed, lost or added is named."""

from __future__ import annotations

import json
import os
import random
import subprocess
from pathlib import Path

import pytest
from older_runs import older_run

from survey_mc.campaign import load_run_campaign, lock_content
from survey_mc.errors import BadInput, RunLocked
from survey_mc.lock_form import lock_digest, lock_text
from survey_mc.run.pack import sweep
from survey_mc.store import Manifest, RunData, RunLayout, run_lock, verify_directory
from survey_mc.store.digest_list import read_digests, write_digests
from survey_mc.store.files import entries, set_aside, write_whole
from survey_mc.store.lock_file import lock_problem, read_lock

N_FLIPS = 300


@pytest.fixture
def root(tmp_path: Path) -> Path:
    return older_run("present", tmp_path)


def found(root: Path) -> list[tuple[str, str]]:
    layout = RunLayout(root)
    damages = verify_directory(layout, Manifest(layout.manifest, tolerant=True))
    return [(damage.kind, damage.path) for damage in damages]


def flips(content: bytes, n: int = N_FLIPS) -> list[bytes]:
    chooser = random.Random(8)
    places = [(chooser.randrange(len(content)), chooser.randrange(8)) for _ in range(n)]
    return [content[:i] + bytes([content[i] ^ 1 << bit]) + content[i + 1 :] for i, bit in places]


def test_the_writer_of_a_lock_and_its_reader_mean_the_same_digest_and_form(root: Path) -> None:
    content = lock_content(load_run_campaign(root))

    assert content["digest"] == lock_digest(content)
    (root / "campaign.lock.json").write_text(lock_text(content))
    assert read_lock(root / "campaign.lock.json") == content
    assert content["campaign_text"] == (root / "campaign.toml").read_text()


def test_every_flipped_bit_of_a_lock_is_seen_and_none_is_read(root: Path) -> None:
    path = root / "campaign.lock.json"
    for content in flips(path.read_bytes()):
        path.write_bytes(content)
        assert lock_problem(path)
        with pytest.raises(BadInput, match="is damaged: "):
            RunData(root)


def test_a_damaged_lock_is_no_witness_against_the_campaign(root: Path) -> None:
    path = root / "campaign.lock.json"
    sha256 = json.loads(path.read_text())["campaign_sha256"]
    path.write_text(path.read_text().replace(sha256, "0" * 64))

    assert found(root) == [("lock", "campaign.lock.json")]


def test_a_lock_without_digest_must_have_its_entries_and_its_form(tmp_path: Path) -> None:
    path = older_run("without_checksums", tmp_path) / "campaign.lock.json"
    content = json.loads(path.read_text())
    assert not lock_problem(path)

    for other in (content | {"dagest": "0"}, {name: content[name] for name in list(content)[1:]}):
        path.write_text(lock_text(other))
        assert lock_problem(path)
    path.write_text(json.dumps(content))
    assert lock_problem(path)


def test_a_lock_that_lacks_what_a_cell_has_is_one_sentence(root: Path) -> None:
    content = {name: value for name, value in read_lock(root / "campaign.lock.json").items() if name != "digest"}
    for cells in ([{"label": "alone"}], ["x"], 7, [content["cells"][0] | {"match_keys": 7}]):
        other = content | {"cells": cells}
        (root / "campaign.lock.json").write_text(lock_text(other | {"digest": lock_digest(other)}))
        with pytest.raises(BadInput, match="lacks what a cell or a method has"):
            RunData(root)


def listed(root: Path) -> RunLayout:
    layout = RunLayout(root)
    for name in ("tables/a.csv", "tables/b.parquet", "report/index.html", "runs/cpu_seconds.csv"):
        (root / name).parent.mkdir(exist_ok=True)
        (root / name).write_text(name)
    write_digests(root, [p for folder in (layout.tables, layout.report) for p in entries(folder)])
    return layout


def test_the_list_of_tables_is_what_sha256sum_reads(root: Path) -> None:
    listed(root)

    command = ["sha256sum", "--check", "--strict", "tables.sha256"]
    check = subprocess.run(command, cwd=root, capture_output=True, text=True)
    assert (check.returncode, check.stdout.count(": OK")) == (0, 3)
    assert not found(root)


def test_every_flipped_bit_of_the_list_or_of_what_it_lists_is_seen(root: Path) -> None:
    layout = listed(root)
    for path in (layout.digests, layout.tables / "a.csv", layout.report / "index.html"):
        whole = path.read_bytes()
        for content in flips(whole, 12):
            path.write_bytes(content)
            assert "table" in {kind for kind, _ in found(root)}
        path.write_bytes(whole)


def test_tables_without_their_list_are_damaged_unless_an_older_version_made_them(root: Path, tmp_path: Path) -> None:
    listed(root).digests.unlink()
    assert found(root) == [("table", "tables.sha256")]

    older = older_run("without_checksums", tmp_path)
    (older / "tables").mkdir()
    (older / "tables" / "a.csv").write_text("a")
    assert not found(older)
    assert read_digests(RunLayout(older)) == {}
    RunLayout(older).digests.write_text("")
    assert found(older) == [("table", "tables.sha256"), ("table", "tables/a.csv")]


def test_a_list_of_tables_has_one_form_and_without_it_nobody_vouches_for_them(root: Path) -> None:
    digests = listed(root).digests
    first, *others = digests.read_text().splitlines(keepends=True)

    for lines in ([*others, first], [first, first, *others]):
        digests.write_text("".join(lines))
        doubtful = ["tables.sha256", "tables/a.csv", "tables/b.parquet", "report/index.html"]
        assert found(root) == [("table", name) for name in doubtful]


def test_what_nobody_knows_is_named_in_every_folder_of_the_run_and_nowhere_else(root: Path) -> None:
    listed(root)
    layout = RunLayout(root)
    strange = ["report/my.txt", "runs/my.txt", "store/my.txt", "store/tmp/my.txt", "store/v1/a/b/mine", "tables/x"]
    temporary = "0" * 32
    left = [
        ".campaign.toml.tmp",
        "attempts/1.note",
        "inputs/old.fits",
        f"store/tmp/{temporary}.parquet",
        f"tables/.a.csv.{temporary}",
    ]
    for name in [*strange, *left, "notes.txt", "my/own.txt"]:
        (root / name).parent.mkdir(parents=True, exist_ok=True)
        (root / name).write_text("")

    assert sorted(path for kind, path in found(root) if kind == "extra") == strange
    assert sorted(path for kind, path in found(root) if kind == "leftover") == left
    sweep(layout, Manifest(layout.manifest))
    assert sorted(path for kind, path in found(root) if kind == "leftover") == left[1:3]


def test_a_name_that_cannot_be_printed_is_shown_and_found(root: Path) -> None:
    name = os.fsdecode(b"store/v1/\xff\n\x1b[31m")
    (root / name).write_text("")

    (damage,) = verify_directory(RunLayout(root), Manifest(root / "manifest.jsonl", tolerant=True))
    assert (root / damage.path).is_file()
    assert damage.shown == "store/v1/\\udcff\\n\\x1b[31m"


def test_links_pipes_and_folders_in_place_of_files_are_named_and_not_followed(root: Path, tmp_path: Path) -> None:
    layout = listed(root)
    first, second, third, _ = layout.piece_files()
    outside = tmp_path / "outside"
    (root / first).rename(outside)
    (root / first).symlink_to(outside)
    (root / second).unlink()
    os.mkfifo(root / second)
    (root / third).unlink()
    (root / third).mkdir()
    os.mkfifo(root / "inputs.fifo")
    os.mkfifo(layout.tables / "pipe")
    (layout.report / "index.html").unlink()
    (layout.report / "index.html").symlink_to("/dev/zero")
    (layout.store / "loop").symlink_to(layout.store)
    (journal,) = layout.journal_files()
    journal.unlink()
    os.mkfifo(journal)

    assert sorted(found(root)) == sorted(
        [
            ("changed", first),
            ("changed", second),
            ("changed", third),
            ("extra", "store/v1/loop"),
            ("extra", "tables/pipe"),
            ("journal", journal.relative_to(root).as_posix()),
            ("table", "report/index.html"),
        ]
    )
    assert list(RunData(root).journal_lines()) == []


@pytest.mark.parametrize("name", ["campaign.toml", "campaign.lock.json", "manifest.jsonl", "tables.sha256"])
@pytest.mark.parametrize("what", ["pipe", "folder", "link", "nothing"])
def test_what_stands_in_place_of_a_file_of_the_run_is_damage(root: Path, name: str, what: str) -> None:
    listed(root)
    path = root / name
    path.rename(root / "elsewhere")
    if what == "pipe":
        os.mkfifo(path)
    elif what == "folder":
        path.mkdir()
    elif what == "link":
        path.symlink_to("elsewhere")

    kinds = {"campaign.toml": "campaign", "campaign.lock.json": "lock", "manifest.jsonl": "manifest"}
    assert (kinds.get(name, "table"), name) in found(root)


def test_a_lock_of_the_process_that_is_no_file_is_refused(tmp_path: Path) -> None:
    victim = tmp_path / "victim"
    victim.write_text("precious")
    (tmp_path / ".lock").symlink_to(victim)

    with pytest.raises(BadInput, match="is a link, not a file"), run_lock(RunLayout(tmp_path)):
        pass
    assert victim.read_text() == "precious"

    (tmp_path / ".lock").unlink()
    with run_lock(RunLayout(tmp_path)), pytest.raises(RunLocked), run_lock(RunLayout(tmp_path)):
        pass


def test_what_is_set_aside_overwrites_nothing(tmp_path: Path) -> None:
    for content in ("first", "second"):
        (tmp_path / "store").mkdir(exist_ok=True)
        (tmp_path / "store" / "mine").write_text(content)
        set_aside(tmp_path, "store/mine", tmp_path / "strays")

    assert (tmp_path / "strays/store/mine").read_text() == "first"
    assert (tmp_path / "strays/store/mine.1").read_text() == "second"


def test_a_failed_write_leaves_the_file_as_it_was(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "a"
    path.write_text("before")

    def full(handle: int) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(OSError, match="No space"):
        write_whole(path, b"after")

    assert [p.name for p in tmp_path.iterdir()] == ["a"]
    assert path.read_text() == "before"


def test_a_deep_tree_is_walked_in_order(tmp_path: Path) -> None:
    deep = tmp_path.joinpath(*"abcdefghij" * 20)
    deep.mkdir(parents=True)
    for path in (deep / "last", tmp_path / "a" / "first", tmp_path / "z"):
        path.write_text("")

    assert [path.name for path in entries(tmp_path)] == ["last", "first", "z"]
    assert list(entries(tmp_path / "nowhere")) == []
