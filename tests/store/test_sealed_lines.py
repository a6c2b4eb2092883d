"""Lines of manifest and journal show every changed byte; what is older or torn is told from what is damaged."""

from __future__ import annotations

import json
import os
import random
import time
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from survey_mc.errors import BadInput, DamagedStore
from survey_mc.store import Damage, Family, Manifest, Piece, Record, RunData, RunLayout, verify_store
from survey_mc.store.journal_lines import drop_damaged_lines, read_lines, seal_line, torn_end
from survey_mc.store.sealed_text import is_sealed, opened, seal

KEY = "0123456789abcdef" * 2
ENTRIES = [
    {"event": "start", "run": "r", "at": "2026-11-22T16:00:00+00:00", "executor": "serial", "workers": 1, "fields": 3},
    {"event": "skip", "cell": "c", "realisation": 1, "method": "β", "reason": 'a "crc": "00000000"}'},
    {"event": "finish", "at": "2026-11-22T16:00:09+00:00", "wall_s": 0.1},
]

texts = st.dictionaries(st.text(max_size=5), st.integers() | st.text(max_size=20), min_size=1, max_size=3)


def record(start: int, stop: int) -> Record:
    return Record(Piece(Family("links", KEY), start, stop), "ab" * 32, 5, 100, 1)


def flipped(content: bytes, n_places: int = 120) -> list[bytes]:
    """The content with one bit flipped: those of the seal at its end, and random others."""
    chooser = random.Random(3)
    places = {*range(len(content) - 24, len(content)), *chooser.sample(range(len(content)), n_places)}
    every = ((byte, chooser.randrange(8)) for byte in sorted(places))
    return [content[:i] + bytes([content[i] ^ 1 << bit]) + content[i + 1 :] for i, bit in every]


@settings(max_examples=50)
@given(texts)
def test_a_sealed_line_is_json_and_gives_its_text_back(content: dict[str, object]) -> None:
    text = json.dumps(content)

    assert json.loads(seal(text)) == content | {"crc": json.loads(seal(text))["crc"]}
    assert opened(seal(text).encode()) == text.encode()
    assert not is_sealed(text.encode()) or "crc" in content


@settings(max_examples=50)
@given(texts, st.data())
def test_any_changed_byte_breaks_a_seal(content: dict[str, object], data: st.DataObject) -> None:
    line = seal(json.dumps(content)).encode()
    place = data.draw(st.integers(0, len(line) - 1))
    other = data.draw(st.integers(0, 255).filter(lambda value: value != line[place]))

    assert opened(line[:place] + bytes([other]) + line[place + 1 :]) is None


@pytest.fixture
def journal(tmp_path: Path) -> Path:
    path = tmp_path / "20261122T160000.000000Z-1.jsonl"
    path.write_text("".join(map(seal_line, ENTRIES)), encoding="utf-8")
    return path


def entries(path: Path) -> list[dict[str, object] | None]:
    return [content for _, content in read_lines(path)]


def test_a_journal_comes_back_as_it_was_written(journal: Path) -> None:
    assert entries(journal) == ENTRIES
    assert [number for number, _ in read_lines(journal)] == [1, 2, 3]


def test_a_flipped_bit_of_a_journal_is_a_damaged_line_or_a_torn_end_and_never_another_entry(journal: Path) -> None:
    whole = journal.read_bytes()
    for content in flipped(whole):
        journal.write_bytes(content)
        found = entries(journal)
        assert all(entry is None or entry in ENTRIES for entry in found)
        assert None in found or (content[-1:] != b"\n" and found == ENTRIES[:-1])


def test_a_flipped_bit_of_a_lone_line_does_not_make_an_older_line_of_it(tmp_path: Path) -> None:
    path = tmp_path / "20261122T160000.000000Z-1.jsonl"
    for content in flipped(seal_line(ENTRIES[0]).encode(), n_places=40):
        path.write_bytes(content)
        assert entries(path) in ([None], [None, None], [])


def test_another_end_of_the_last_line_is_damage_and_a_torn_line_is_not(journal: Path) -> None:
    whole = journal.read_bytes()

    assert torn_end(journal) is None
    journal.write_bytes(whole[:-1] + b"\x0b")
    assert torn_end(journal) == (3, True)
    journal.write_bytes(whole[:-9])
    assert torn_end(journal) == (3, False)


def test_a_repaired_journal_has_its_sound_lines_and_nothing_else(journal: Path) -> None:
    first, second, third = journal.read_bytes().splitlines(keepends=True)
    journal.write_bytes(first + second.replace(b"skip", b"slip") + third + b'{"event": "ta')

    drop_damaged_lines(journal)

    assert journal.read_bytes() == first + third


def test_a_journal_without_checksums_is_read_and_what_is_no_json_or_lacks_an_entry_is_left_out(journal: Path) -> None:
    lines = [json.dumps(entry) for entry in ENTRIES]
    journal.write_text("\n".join([*lines, "{", "[]", '{"event": "skip"}', "[" * 9999, '{"torn": ']))

    assert entries(journal) == [*ENTRIES, None, None, None, None]


def test_a_line_without_checksum_among_sealed_ones_is_damaged(journal: Path) -> None:
    with journal.open("a") as handle:
        handle.write('{"event": "finish"}\n')

    assert entries(journal)[-1] is None


def test_a_pipe_in_place_of_a_journal_or_a_manifest_holds_nobody_up(tmp_path: Path) -> None:
    layout = RunLayout(tmp_path)
    os.mkfifo(layout.manifest)
    os.mkfifo(tmp_path / "20261122T160000.000000Z-1.jsonl")

    assert entries(tmp_path / "20261122T160000.000000Z-1.jsonl") == []
    with pytest.raises(DamagedStore, match="is a pipe, not a file"):
        Manifest(layout.manifest)
    with pytest.raises(BadInput):
        RunData(tmp_path)


COST = {"method": "G", "stage": "detect", "fields": 3, "cpu_s": 1, "wall_s": 0.5}
TASK = {"event": "task", "at": "2026-11-22T16:00:00+00:00", "cell": "c", "start": 0, "stop": 3, "costs": [COST]}


@pytest.mark.parametrize(
    "change",
    [
        {"at": "2026-11-2rT16"},
        {"at": 7},
        {"start": "0"},
        {"costs": [7]},
        {"costs": [COST | {"cpu_s": "1"}]},
        {"costs": {}},
    ],
    ids=str,
)
def test_an_entry_that_its_readers_could_not_use_is_left_out(tmp_path: Path, change: dict[str, object]) -> None:
    path = tmp_path / "20261122T160000.000000Z-1.jsonl"
    path.write_text(json.dumps(TASK) + "\n" + json.dumps(TASK | change) + "\n")

    assert entries(path) == [TASK, None]


@pytest.fixture
def layout(tmp_path: Path) -> RunLayout:
    layout = RunLayout(tmp_path)
    manifest = Manifest(layout.manifest)
    manifest.add([record(0, 4), record(4, 8)])
    manifest.drop([record(0, 4).piece])
    return layout


def wrong(layout: RunLayout) -> list[Damage]:
    return [d for d in verify_store(layout, Manifest(layout.manifest, tolerant=True)) if d.kind == "manifest"]


def test_a_flipped_bit_of_a_manifest_is_a_damaged_line(layout: RunLayout) -> None:
    for content in flipped(layout.manifest.read_bytes()):
        layout.manifest.write_bytes(content)
        assert Manifest(layout.manifest, tolerant=True).damaged_lines


def test_a_manifest_without_checksums_is_read_and_no_changed_bit_makes_another_file_of_it(layout: RunLayout) -> None:
    kept = [(opened(line) or b"").decode() + "\n" for line in layout.manifest.read_bytes().splitlines()]
    layout.manifest.write_text("".join(kept))
    assert list(Manifest(layout.manifest)) == [record(4, 8)]

    for content in flipped(kept[1].encode()):
        layout.manifest.write_bytes(content)
        found = Manifest(layout.manifest, tolerant=True)
        assert found.damaged_lines or list(found) != [record(4, 8)] or found.is_torn


def test_a_changed_letter_of_an_older_manifest_does_not_make_a_later_store_of_it(layout: RunLayout) -> None:
    kept = [(opened(line) or b"").decode() + "\n" for line in layout.manifest.read_bytes().splitlines()]
    layout.manifest.write_text(kept[0] + kept[1].replace("store/v1/", "store/v3/"))

    assert [damage.kind for damage in wrong(layout)] == ["manifest"]
    with pytest.raises(DamagedStore, match="names a file outside the store"):
        Manifest(layout.manifest)


@pytest.mark.parametrize(
    "line",
    [
        '{"path": 7}',
        "null",
        "7",
        '{"drop": "/etc/passwd"}',
        record(0, 4).line().replace("links", "../../links").strip(),
        record(4, 0).line().strip(),
        (opened(record(0, 4).line().strip().encode()) or b"").decode().replace("0000000-0000004", "0000004-0000000"),
        (opened(record(0, 4).line().strip().encode()) or b"").decode().replace('"rows": 5', '"rows": -5'),
        (opened(record(0, 4).line().strip().encode()) or b"").decode().replace('"rows": 5', '"rows": 1e9'),
    ],
)
def test_a_line_that_is_none_of_ours_names_no_file(layout: RunLayout, line: str) -> None:
    layout.manifest.write_text(line + "\n" + record(4, 8).line())

    assert list(Manifest(layout.manifest, tolerant=True)) == [record(4, 8)]
    assert [d.about.split()[:2] for d in wrong(layout)] == [["line", "1"]]


def test_ten_thousand_files_are_opened_in_half_a_second(tmp_path: Path) -> None:
    path = tmp_path / "manifest.jsonl"
    path.write_text("".join(record(start, start + 1).line() for start in range(10_000)))
    begun_s = time.process_time()

    assert len(Manifest(path)) == 10_000
    assert time.process_time() - begun_s < 0.5
