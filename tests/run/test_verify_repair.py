"""A repair gives back every byte, computes nothing but what was damaged, and touches nothing that was sound."""

from __future__ import annotations

import os
import shutil
from pathlib import Path

import pytest
from damaged_runs import contents, make_run, times, write_campaign

from survey_mc.campaign import load_campaign
from survey_mc.errors import BadInput, DamagedStore, RunLocked
from survey_mc.report import build_tables, remake_report
from survey_mc.run import VerifyResult, open_run, run_campaign, verify_run
from survey_mc.run.executors import ExecutorChoice
from survey_mc.store import Manifest, RunData, RunLayout, run_lock

SERIAL = ExecutorChoice(serial=True)


@pytest.fixture(scope="module")
def finished(tmp_path_factory: pytest.TempPathFactory) -> Path:
    root = make_run(tmp_path_factory.mktemp("whole"), report=False)
    build_tables(RunData(root), root)
    return root


@pytest.fixture
def root(finished: Path, tmp_path: Path) -> Path:
    return Path(shutil.copytree(finished, tmp_path / "run"))


def repair(root: Path) -> VerifyResult:
    return verify_run(root, repair=True, executor=SERIAL, remake_report=remake_report)


def but_journals(files: dict[str, bytes]) -> dict[str, bytes]:
    return {path: content for path, content in files.items() if not path.endswith(".jsonl")} | {
        "manifest.jsonl": files.get("manifest.jsonl", b"")
    }


def pieces(root: Path, table: str) -> list[Path]:
    return sorted((root / "store" / "v1" / table).rglob("*.parquet"))


def costs(root: Path) -> dict[tuple[str, str], int]:
    """Fields worked on by the last process, by method and stage."""
    journal = open_run(root).journal()
    last = journal[journal["started"] == journal["started"].max()]
    return last[last["stage"] != "commit"].groupby(["method", "stage"])["fields"].sum().to_dict()


def test_a_sound_run_is_left_alone(root: Path) -> None:
    before = times(root)

    result = repair(root)

    assert result.sound
    assert result.repaired is None
    assert times(root) == before


def test_only_damaged_files_are_computed_and_written_again(root: Path) -> None:
    whole, before = contents(root), times(root)
    flipped, gone = pieces(root, "matches")[0], pieces(root, "detections")[-1]
    flipped.write_bytes(flipped.read_bytes()[:-1] + b"?")
    gone.unlink()

    result = repair(root)

    assert result.mended
    assert but_journals(contents(root)) == but_journals(whole)
    touched = {flipped.relative_to(root).as_posix(), gone.relative_to(root).as_posix(), "manifest.jsonl"}
    after = times(root)
    assert {path for path, time in before.items() if after[path] != time} <= touched
    # Two fields of one method to match, two of the other to search; each is drawn once.
    (matched,) = [label for label, stage in costs(root) if stage == "match"]
    (searched,) = [label for label, stage in costs(root) if stage == "detect"]
    assert costs(root) == {("", "draw"): 4, (matched, "match"): 2, (searched, "detect"): 2}
    assert result.repaired is not None
    assert result.repaired.fields == 4
    assert verify_run(root, n_replay=3).sound


def test_what_lies_beside_a_damaged_file_of_the_same_fields_keeps_its_time(root: Path) -> None:
    before = times(root)
    pieces(root, "links")[0].unlink()

    assert repair(root).mended
    after = times(root)
    assert [path for path, time in before.items() if after[path] != time and "/matches/" in path] == []


def test_a_repair_does_not_go_on_with_an_unfinished_run(tmp_path: Path) -> None:
    few = load_campaign(write_campaign(tmp_path))
    run_campaign(few, tmp_path / "run", SERIAL)
    more = load_campaign(write_campaign(tmp_path, ("realisations = 6", "realisations = 60")))
    from survey_mc.run.engine import write_campaign as keep_campaign

    keep_campaign(more, RunLayout(tmp_path / "run"))
    whole = contents(tmp_path / "run")
    for table in ("truth", "matches"):
        pieces(tmp_path / "run", table)[-1].unlink()

    result = repair(tmp_path / "run")

    assert result.mended
    assert result.lacking == 2 * 54
    assert but_journals(contents(tmp_path / "run")) == but_journals(whole)
    assert costs(tmp_path / "run")["", "draw"] <= 4


@pytest.mark.parametrize(
    ("name", "content"),
    [
        ("campaign.toml", None),
        ("campaign.toml", b"schema = \xff"),
        ("campaign.lock.json", None),
        ("campaign.lock.json", b""),
        ("campaign.lock.json", b"\xff{"),
        ("manifest.jsonl", None),
        ("manifest.jsonl", b"nothing of ours\n"),
        ("manifest.jsonl", b'{"drop": "../../x"}\n'),
    ],
)
def test_a_lost_or_garbled_file_around_the_store_is_made_again(root: Path, name: str, content: bytes | None) -> None:
    whole = contents(root)
    if content is None:
        (root / name).unlink()
    else:
        (root / name).write_bytes(content)
    assert not verify_run(root).sound

    result = repair(root)

    assert result.mended
    assert but_journals(contents(root)) == but_journals(whole)
    assert verify_run(root).sound


def test_campaign_and_lock_that_were_swapped_are_swapped_back(root: Path) -> None:
    whole = contents(root)
    (root / "campaign.toml").write_bytes(whole["campaign.lock.json"])
    (root / "campaign.lock.json").write_bytes(whole["campaign.toml"])

    assert repair(root).mended
    assert but_journals(contents(root)) == but_journals(whole)


@pytest.mark.parametrize("bit", range(0, 48, 7))
def test_a_flipped_bit_around_the_store_is_put_right(root: Path, bit: int) -> None:
    whole = contents(root)
    for name in ("campaign.toml", "campaign.lock.json", "manifest.jsonl"):
        content = bytearray(whole[name])
        content[bit * len(content) // 48] ^= 1 << bit % 8
        (root / name).write_bytes(content)
        result = repair(root)
        assert result.mended, (name, result.differences)
        assert but_journals(contents(root)) == but_journals(whole)


def test_lines_cut_from_a_manifest_are_computed_again(root: Path) -> None:
    whole = contents(root)
    lines = (root / "manifest.jsonl").read_bytes().splitlines(keepends=True)
    (root / "manifest.jsonl").write_bytes(b"".join(lines[:-2]))

    found = verify_run(root)
    result = repair(root)

    assert [damage.kind for damage in found.damages] == ["leftover", "leftover"]
    assert (found.lacking, result.lacking) == (0, 0)  # the last lines are those of the truth
    assert result.mended
    assert but_journals(contents(root)) == but_journals(whole)


def test_damaged_lines_of_a_journal_are_removed_and_the_others_kept(root: Path) -> None:
    (journal,) = RunLayout(root).journal_files()
    lines = journal.read_bytes().splitlines(keepends=True)
    journal.write_bytes(lines[0] + lines[1].replace(b"task", b"tusk") + b"".join(lines[2:]) + b'{"event')

    result = repair(root)

    assert sorted(damage.kind for damage in result.damages) == ["journal", "leftover"]
    assert journal.read_bytes() == lines[0] + b"".join(lines[2:])
    assert verify_run(root).sound


def test_a_damaged_input_is_named_and_nothing_is_touched(root: Path) -> None:
    image = root / "inputs" / "sky" / "blob.fits"
    image.write_bytes(image.read_bytes()[:-3000])
    pieces(root, "truth")[0].unlink()
    before = contents(root)

    with pytest.raises(DamagedStore, match=r"blob.fits: is not what the run was made with .* put it back"):
        repair(root)
    assert contents(root) == before


def test_without_campaign_and_lock_a_person_has_to_help(root: Path) -> None:
    (root / "campaign.toml").write_text("schema = 1")
    (root / "campaign.lock.json").write_text("{}")

    with pytest.raises(DamagedStore, match="survey-mc run` with the campaign file"):
        repair(root)


def test_a_campaign_that_did_not_make_the_store_is_not_taken_for_the_one_that_did(root: Path) -> None:
    (root / "campaign.lock.json").write_text("{}")
    campaign = root / "campaign.toml"
    campaign.write_text(campaign.read_text().replace("seed = 11", "seed = 12"))

    with pytest.raises(DamagedStore, match="nothing in it says any more"):
        repair(root)


def test_links_folders_and_pipes_in_place_of_files_give_way_and_nothing_of_others_is_deleted(
    root: Path, tmp_path: Path
) -> None:
    whole = contents(root)
    (truth, *_), (links, *_), (matches, *_) = (pieces(root, name) for name in ("truth", "links", "matches"))
    precious = tmp_path / "precious"
    precious.write_text("precious")
    truth.unlink()
    truth.symlink_to(precious)
    links.unlink()
    links.mkdir()
    (links / "thesis.tex").write_text("thesis")
    matches.unlink()
    os.mkfifo(matches)
    (root / "tables" / "mine.txt").write_text("mine")
    (root / ".lock").unlink()
    (root / ".lock").symlink_to(precious)

    assert repair(root).mended

    after = contents(root)
    aside = {path: content for path, content in after.items() if path.startswith("strays/")}
    assert {path: content for path, content in but_journals(after).items() if path not in aside} == but_journals(whole)
    assert b"thesis" in aside.values()
    assert b"mine" in aside.values()
    assert precious.read_text() == "precious"
    assert verify_run(root).sound


def test_damaged_tables_are_made_again_where_somebody_can(root: Path) -> None:
    whole = contents(root)
    (root / "tables" / "completeness.csv").write_text("1")
    (root / "tables" / "astrometry.parquet").unlink()

    alone = verify_run(root, repair=True, executor=SERIAL)
    assert not alone.mended
    assert "survey-mc report" in alone.differences[0]
    assert repair(root).mended
    assert contents(root) == whole


def test_a_file_that_comes_out_otherwise_is_said_to(root: Path) -> None:
    """As with other library versions: the manifest has another SHA-256 than the file that is computed."""
    manifest = Manifest(root / "manifest.jsonl")
    piece = next(iter(manifest)).piece
    path = root / piece.path
    path.write_bytes(path.read_bytes() + b"\n")
    from survey_mc.store import Record
    from survey_mc.store.files import file_sha256

    record = manifest.record(piece)
    assert record is not None
    manifest.add([Record(piece, file_sha256(path), record.rows, path.stat().st_size, 1)])
    path.unlink()

    result = repair(root)

    assert not result.mended
    assert "computed again it is another file" in result.differences[0]
    assert verify_run(root).sound


def test_a_damaged_file_of_another_state_of_the_campaign_is_dropped_and_said_to_be(tmp_path: Path) -> None:
    root = make_run(tmp_path, report=False)
    before = {path.name for path in (root / "store/v1/matches").iterdir()}
    wider = load_campaign(write_campaign(tmp_path, ("counts_min = 10", "counts_min = 10\nradius_arcsec = 12.0")))
    run_campaign(wider, root, SERIAL)
    old = next(path for path in pieces(root, "matches") if path.parent.name in before)
    old.write_bytes(b"")

    result = repair(root)

    assert not result.mended
    assert "another state of the campaign" in result.differences[0]
    assert not old.exists()
    assert verify_run(root).sound


def test_a_repair_waits_for_no_other_process_and_a_check_needs_no_lock(root: Path) -> None:
    with run_lock(RunLayout(root)):
        assert verify_run(root).sound
        with pytest.raises(RunLocked):
            repair(root)


def test_a_published_run_without_its_store_is_left_as_it_is(root: Path) -> None:
    shutil.rmtree(root / "store")
    (root / "manifest.jsonl").unlink()
    (root / "tables" / "completeness.csv").write_text("damaged")
    before = contents(root)

    assert {damage.kind for damage in verify_run(root).damages} == {"manifest", "table"}
    with pytest.raises(DamagedStore, match="has nothing stored"):
        repair(root)
    assert contents(root) == before


@pytest.mark.parametrize("name", ["nowhere", "a file", "a folder"])
def test_what_is_no_run_directory_is_refused_and_left_as_it_was(tmp_path: Path, name: str) -> None:
    (tmp_path / "a file").write_text("")
    (tmp_path / "a folder" / "store").mkdir(parents=True)

    for mend in (False, True):
        with pytest.raises(BadInput, match="is not a run directory"):
            verify_run(tmp_path / name, repair=mend)
    assert sorted(path.name for path in tmp_path.rglob("*")) == ["a file", "a folder", "store"]
