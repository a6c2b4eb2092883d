"""A run directory from a stranger: what it holds is read as data, shown as text, and never followed elsewhere."""

from __future__ import annotations

import hashlib
import json
import os
import pickle
import re
import shutil
from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path
from types import SimpleNamespace

import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from command import command, contents
from payloads import PAYLOADS
from small_campaigns import TEXT

from survey_mc import open_run
from survey_mc.detect import DETECTORS
from survey_mc.errors import SurveyError
from survey_mc.lock_form import lock_digest, lock_text
from survey_mc.report.markup import Html, tag, text
from survey_mc.report.page_shell import EMBEDDED_ONLY, FILES_BESIDE, Section, heading, page, plain_table
from survey_mc.store import Manifest

SMALL = TEXT.replace("realisations = 6", "realisations = 1").replace("n_pix = 128", "n_pix = 64")
HOSTILE = "<script>alert('x')</script><img src=http://evil/x onerror=alert(1)>\"'><svg/onload=alert(1)>&#60;b&gt;"


class Canary:
    """Makes a file when it is unpickled."""

    def __reduce__(self) -> tuple[object, tuple[str]]:
        return Path.touch, (Path("CANARY").absolute(),)  # type: ignore[return-value]


@pytest.fixture(scope="module")
def good(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("good")
    (folder / "c.toml").write_text(SMALL)
    assert command("run", folder / "c.toml", "--serial", "--no-report", "--out", folder / "run").code == 0
    return folder


@pytest.fixture
def run(good: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A copy of a good run, and something precious beside it."""
    monkeypatch.chdir(tmp_path)
    shutil.copytree(good, tmp_path, dirs_exist_ok=True)
    (tmp_path / "outside").mkdir()
    (tmp_path / "outside" / "precious.txt").write_text("precious")
    return tmp_path / "run"


def put_piece(run: Path, name: str, change: Callable[[pa.Table], pa.Table]) -> None:
    """Change a stored table and make the manifest agree, as only malice would."""
    records = list(Manifest(run / "manifest.jsonl"))
    place = next(i for i, record in enumerate(records) if record.piece.family.table == name)
    path = run / records[place].piece.path
    data = change(pq.read_table(path, partitioning=None))
    pq.write_table(data, path, compression="zstd")
    content = path.read_bytes()
    records[place] = replace(
        records[place],
        sha256=hashlib.sha256(content).hexdigest(),
        size_bytes=len(content),
        rows=data.num_rows,
    )
    (run / "manifest.jsonl").write_text("".join(record.line() for record in records))


def pickled_type(data: pa.Table) -> pa.Table:
    """The extension type that older Arrow unpickled on reading (CVE-2023-47248)."""
    payload = {
        b"ARROW:extension:name": b"arrow.py_extension_type",
        b"ARROW:extension:metadata": pickle.dumps(Canary()),
    }
    fields = [field.with_metadata({**(field.metadata or {}), **payload}) for field in data.schema]
    return data.cast(pa.schema(fields, metadata=data.schema.metadata))


TAMPERED: dict[str, Callable[[pa.Table], pa.Table]] = {
    "extension type with a pickle": pickled_type,
    "a column less": lambda data: data.drop_columns([data.column_names[-1]]),
    "no column": lambda data: data.select([]),
    "a column of another type": lambda data: data.set_column(
        0, data.column_names[0], pa.array([HOSTILE] * data.num_rows)
    ),
    "no schema metadata": lambda data: data.replace_schema_metadata({}),
    "pandas metadata of a stranger": lambda data: data.replace_schema_metadata(
        {**data.schema.metadata, b"pandas": b'{"index_columns": ["__import__(\'os\')"], "columns": 5}'}
    ),
    "markup in a text column": lambda data: data.set_column(
        data.column_names.index("rule"), "rule", pa.array([HOSTILE] * data.num_rows)
    ),
    "a nested column": lambda data: data.set_column(0, data.column_names[0], pa.array([[[1]]] * data.num_rows)),
}


@pytest.mark.parametrize("case", TAMPERED, ids=lambda case: case.replace(" ", "_"))
def test_a_stored_table_of_a_stranger_is_data_or_damage(run: Path, case: str) -> None:
    put_piece(run, "matches", TAMPERED[case])
    before = contents(run.parent / "outside")

    with suppress(SurveyError):
        assert len(open_run(run).matches().columns) > 0
    answer = command("verify", run)

    assert answer.code in (0, 4)
    assert "Traceback" not in answer.err
    assert not (run.parent / "CANARY").exists()
    assert contents(run.parent / "outside") == before


class Page(HTMLParser):
    """Elements, attributes and visible text of a page."""

    def __init__(self, content: str) -> None:
        super().__init__()
        self.elements: list[tuple[str, dict[str, str | None]]] = []
        self.words: list[str] = []
        self.feed(content)
        self.close()

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.elements.append((tag, dict(attrs)))

    def handle_data(self, data: str) -> None:
        self.words.append(data)


def assert_inert(content: str) -> Page:
    """No script, no event, no link or picture from elsewhere, and the policy that forbids them."""
    shown = Page(content)
    names = {name for name, _ in shown.elements}
    assert not names & {"script", "iframe", "object", "embed", "svg", "base", "form", "link", "video", "audio"}
    for name, attributes in shown.elements:
        assert not [key for key in attributes if key.startswith("on") or key in ("style", "srcset", "formaction")]
        for key in ("href", "src"):
            target = attributes.get(key) or ""
            assert not re.match(r"\s*[^/?#]*:", target) or target.startswith("data:image/png;base64,"), (name, target)
            assert not re.match(r"\s*[/\\]{2}", target)
    policy = next(a["content"] for n, a in shown.elements if a.get("http-equiv") == "Content-Security-Policy")
    assert policy is not None
    assert policy.startswith("default-src 'none'; ")
    assert "script" not in policy
    assert "http" not in policy
    return shown


@pytest.mark.parametrize("images", [EMBEDDED_ONLY, FILES_BESIDE])
def test_a_page_shows_every_text_and_obeys_none(images: str) -> None:
    words = [*PAYLOADS, HOSTILE, "a\u202eb", "\x00\x1b[31m", "\ud800"]
    table = plain_table(words, [words])
    sections = (Section("s", HOSTILE, table, tuple(("a", word) for word in words)),)
    content = page(HOSTILE, heading(HOSTILE, HOSTILE, {word: word for word in words}), sections, images)

    shown = assert_inert(content)

    assert HOSTILE in shown.words
    assert not set(content) & {"\u202e", "\x00", "\x1b", "\ud800"}
    content.encode("utf-8")


@pytest.mark.parametrize(
    "target",
    ["javascript:alert(1)", "JaVaScRiPt:alert(1)", " javascript:x", "java\nscript:x", "data:text/html,x", "//evil/x",
     "\\\\evil\\x", "http://evil", "vbscript:x", "file:///etc/passwd", "data:image/svg+xml;base64,x", "/\\evil"],
)  # fmt: skip
@pytest.mark.parametrize("key", ["href", "src"])
def test_no_name_becomes_a_link_to_elsewhere(target: str, key: str) -> None:
    made = tag("a", "x", **{key: target})

    ((_, attributes),) = Page(made).elements
    assert str(attributes[key]).startswith("./")
    assert Page(tag("img", src="data:image/png;base64,AA")).elements == [("img", {"src": "data:image/png;base64,AA"})]
    assert Page(tag("a", "x", href="../tables/a.csv")).elements == [("a", {"href": "../tables/a.csv"})]
    assert Page(tag("a", "x", href="#a:b")).elements == [("a", {"href": "#a:b"})]


def test_markup_in_an_attribute_is_escaped_even_when_it_is_finished() -> None:
    assert tag("p", title=Html('"><script>')) == '<p title="&quot;&gt;&lt;script&gt;"></p>'
    assert text(HOSTILE).count("<") == 0


def hostile_lock(run: Path) -> None:
    """Put markup into every text of the lock file of a run."""
    path = run / "campaign.lock.json"
    lock = json.loads(path.read_text())
    is_sealed = lock.pop("digest", None) is not None
    lock |= {"name": HOSTILE, "about": HOSTILE, "seed": HOSTILE, "versions": {HOSTILE: HOSTILE, "survey_mc": HOSTILE}}
    (method,) = lock["methods"]
    keys = ("detect_keys", "match_keys")
    for cell in lock["cells"]:
        cell |= {key: {HOSTILE: next(iter(cell[key].values()))} for key in keys}
        cell |= {"instrument": HOSTILE, "band": HOSTILE}
    method |= {"label": HOSTILE, "reference": HOSTILE, "version": HOSTILE, "params": {HOSTILE: HOSTILE}}
    path.write_text(lock_text(lock | {"digest": lock_digest(lock)} if is_sealed else lock))


def test_the_answers_of_a_hostile_run_hold_no_control_characters(run: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(*arguments: object) -> None:
        raise RuntimeError("\x1b[31mred\x1b]0;title\x07 \u202e <script>")

    monkeypatch.setitem(DETECTORS._entries, "gauss_se", replace(DETECTORS["gauss_se"], detect=fail))
    command("run", "c.toml", "--serial", "--no-report", "--out", "failed")

    answer = command("status", "failed")

    assert answer.code == 3
    assert "red" in answer.out
    assert not {"\x1b", "\x07", "\u202e"} & set(answer.out)
    assert json.loads(command("status", "failed", "--json").out)["failures"]


@pytest.mark.parametrize("folder", ["report", "tables", "runs", "inputs"])
@pytest.mark.parametrize(
    "words", [("report",), ("verify", "--repair", "--serial"), ("run",)], ids=lambda words: words[0]
)
def test_a_folder_of_a_run_that_is_a_link_is_neither_written_nor_tidied(
    run: Path, folder: str, words: tuple[str, ...]
) -> None:
    outside = run.parent / "outside"
    shutil.rmtree(run / folder, ignore_errors=True)
    (run / folder).symlink_to(outside)
    (outside / "index.html").write_text("mine")
    before = contents(outside)

    answer = (
        command("run", "c.toml", "--serial", "--out", run) if words == ("run",) else command(words[0], run, *words[1:])
    )

    assert answer.code in (2, 4)
    assert contents(outside) == before


def test_a_repair_touches_nothing_in_a_store_that_lies_elsewhere(run: Path) -> None:
    outside = run.parent / "outside"
    shutil.move(run / "store", outside / "store")
    (outside / "store" / "thesis.tex").write_text("precious")
    (run / "store").symlink_to(outside / "store")
    before = contents(outside)

    answer = command("verify", run, "--repair", "--serial")
    assert answer.code == 2
    assert "is a link" in answer.err
    assert contents(outside) == before


def test_a_repair_deletes_nothing_behind_a_link_within_the_store(run: Path) -> None:
    outside = run.parent / "outside"
    (table,) = (run / "store" / "v1" / "truth").iterdir()
    shutil.move(table, outside / table.name)
    for path in (outside / table.name).iterdir():
        path.write_bytes(b"precious")
    table.symlink_to(outside / table.name)
    before = contents(outside)

    assert command("run", "c.toml", "--serial", "--no-report", "--out", run).code in (0, 2, 4)
    assert contents(outside) == before
    assert command("verify", run, "--repair", "--serial").code == 0
    assert contents(outside) == before
    assert command("verify", run).code == 0


IRREGULAR: dict[str, Callable[[Path], object]] = {
    "pipe": lambda path: os.mkfifo(path),
    "device": lambda path: path.symlink_to("/dev/zero"),
    "link": lambda path: path.symlink_to(path.parents[1] / "outside" / "precious.txt"),
    "nested list": lambda path: path.write_text("[" * 100_000),
    "no text": lambda path: path.write_bytes(b"\xff\xfe" * 100),
    "nothing": lambda path: path.write_bytes(b""),
}


@pytest.mark.parametrize("kind", IRREGULAR)
@pytest.mark.parametrize("name", ["campaign.toml", "campaign.lock.json", "manifest.jsonl", "tables.sha256", ".lock"])
def test_what_stands_in_for_a_file_of_a_run_is_not_waited_for_or_written_through(
    run: Path, kind: str, name: str
) -> None:
    before = contents(run.parent / "outside")
    for words in (("status", run), ("verify", run), ("run", "c.toml", "--serial", "--no-report", "--out", run)):
        (run / name).unlink(missing_ok=True)
        IRREGULAR[kind](run / name)
        answer = command(*words)
        assert answer.code in (0, 2, 4)
        assert "Traceback" not in answer.err
    assert contents(run.parent / "outside") == before


def test_a_planted_link_under_a_temporary_name_is_not_followed(run: Path) -> None:
    precious = run.parent / "outside" / "precious.txt"
    names = (".campaign.toml.tmp", ".campaign.lock.json.tmp", "manifest.tmp", "report/.index.html.tmp")
    (run / "report").mkdir(exist_ok=True)
    for name in names:
        (run / name).symlink_to(precious)
    for name in ("campaign.toml", "campaign.lock.json"):
        (run / name).write_bytes(b"")
    (run / "campaign.toml").write_bytes((run.parent / "c.toml").read_bytes() + b"\n")

    command("run", "c.toml", "--serial", "--no-report", "--out", run)

    assert precious.read_text() == "precious"


def test_the_page_of_a_study_is_as_inert() -> None:
    from survey_mc.paper.page import _campaigns, _figure

    lock = {"about": HOSTILE, "seed": HOSTILE, "versions": {HOSTILE: HOSTILE}}
    data = SimpleNamespace(lock=lock, cells=())
    results = SimpleNamespace(
        campaigns=[SimpleNamespace(name="javascript:alert(1)//"), SimpleNamespace(name=HOSTILE)],
        run=lambda name: SimpleNamespace(data=data, tables={}, cells=(), methods=()),
        has=lambda name: True,
    )
    rows = _campaigns(results)  # type: ignore[arg-type]
    sections = (Section("c", HOSTILE, rows), Section("f", HOSTILE, _figure(HOSTILE, HOSTILE, HOSTILE)))

    assert_inert(page(HOSTILE, heading(HOSTILE, HOSTILE, {}), sections, FILES_BESIDE))
