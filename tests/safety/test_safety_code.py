"""Nothing in a campaign, an input file, a run directory or an option is ever executed."""

from __future__ import annotations

import ast
import json
import os
import pickle
import shutil
import subprocess
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from command import command
from payloads import PAYLOADS, PLACES, TEMPTING_NAMES, campaigns_with, launcher, quoted
from small_campaigns import TEXT

import survey_mc
from survey_mc.campaign import load_campaign

SMALL = TEXT.replace("realisations = 6", "realisations = 1").replace("n_pix = 128", "n_pix = 64")

TEMPTING = (
    "[__class__]\n__init__ = 'evil'", "[sky._target_]\nx = 'evil'", "include = 'evil.toml'", "extends = 'evil.toml'",
    "[plugins]\ndetectors = ['evil:DETECTOR']", "[detectors]\nevil = 'evil:DETECTOR'", "import = 'evil'",
    "hooks = ['evil:x']",
    "[instrument.__dict__]\nname = 'x'", "model_config = { extra = 'allow' }", "[method.detector]\nentry = 'evil:x'",
)  # fmt: skip


class Evil:
    """Makes the canary when it is unpickled."""

    def __reduce__(self) -> tuple[object, tuple[str]]:
        return Path.touch, (Path("CANARY").absolute(),)  # type: ignore[return-value]


@pytest.fixture
def canary(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """A file that must not be there at the end; modules that would make it lie where campaigns lie."""
    monkeypatch.chdir(tmp_path)
    made = f"open({str(tmp_path / 'CANARY')!r}, 'w')\nDETECTOR = x = None\n"
    for name in ("evil.py", "numba_kernels.py", "sitecustomize.py", "conftest.py", "evil.toml"):
        (tmp_path / name).write_text(made)
    yield tmp_path / "CANARY"
    assert not (tmp_path / "CANARY").exists()


def test_the_canary_is_made_by_what_it_is_to_show(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    pickle.loads(pickle.dumps(Evil()))  # noqa: S301

    assert (tmp_path / "CANARY").exists()


def test_workers_import_nothing_from_the_folder_of_a_campaign(tmp_path: Path) -> None:
    work = tmp_path / "work"
    work.mkdir()
    for name in TEMPTING_NAMES:
        (work / f"{name}.py").write_text(f"open({str(work / 'CANARY')!r}, 'a').write({name!r})\nraise ImportError\n")
    (work / "c.toml").write_text(SMALL)
    words = ("run", "c.toml", "--workers", "1", "--no-report", "--out", "run")
    environment = os.environ | {"PYTHONPATH": str(PACKAGE.parent)}

    done = subprocess.run([*launcher(tmp_path), *words], cwd=work, env=environment, capture_output=True, check=False)

    assert done.returncode == 0, done.stderr
    assert not (work / "CANARY").exists()


@pytest.mark.parametrize("payload", PAYLOADS, ids=lambda payload: ascii(payload[:40]))
def test_a_payload_in_a_campaign_stays_text(canary: Path, payload: str) -> None:
    for text in campaigns_with(payload, SMALL, every=3, first=PAYLOADS.index(payload)):
        (canary.parent / "c.toml").write_text(text)
        answer = command("validate", "c.toml")
        assert "Traceback" not in answer.err
        assert answer.code in (0, 2)


@pytest.mark.parametrize("extra", TEMPTING, ids=lambda extra: ascii(extra[:30]))
def test_keys_that_load_code_elsewhere_are_unknown_here(canary: Path, extra: str) -> None:
    first, second = SMALL.split("[instrument]")
    text = f"{first}{extra}\n[instrument]{second}" if not extra.startswith("[") else f"{SMALL}\n{extra}"
    (canary.parent / "c.toml").write_text(text)

    answer = command("validate", "c.toml")

    assert answer.code == 2
    assert "is not a known key" in answer.err or "is not TOML" in answer.err


def test_a_payload_is_carried_through_a_whole_run_as_text(canary: Path) -> None:
    labels = [p for p in PAYLOADS if len(p) <= 60 and "\\n" not in p and not p.startswith("=")][:4]
    methods = "".join(f'\n[[method]]\nname = "gauss_se"\nlabel = "{quoted(label)}"\n' for label in labels)
    about = quoted(" ".join(p for p in PAYLOADS if "\\n" not in p))
    text = SMALL.replace('label = "G"', 'label = "G"\n').replace("seed = 7", f'seed = 7\nabout = "{about}"')
    (canary.parent / "c.toml").write_text(text + methods)

    assert command("run", "c.toml", "--serial", "--no-report", "--out", "run").code == 0
    assert command("status", "run").code == 0
    assert command("verify", "run", "--replay", "1").code == 0
    assert {m.label for m in load_campaign("c.toml").method} >= {json.loads(f'"{quoted(label)}"') for label in labels}


@pytest.mark.parametrize("kind", ["pickle", "npy", "npz", "text"])
@pytest.mark.parametrize("role", ["image", "exposure", "background", "sky", "network", "campaign", "regions"])
def test_a_file_of_objects_is_no_input(canary: Path, kind: str, role: str) -> None:
    folder = canary.parent
    if kind == "pickle":
        (folder / "evil.bin").write_bytes(pickle.dumps(Evil()))
    elif kind == "text":
        (folder / "evil.bin").write_text((folder / "evil.py").read_text())
    else:
        objects = np.array([Evil()], dtype=object)
        if kind == "npy":
            np.save(folder / "evil.npy", objects, allow_pickle=True)
        else:
            np.savez(folder / "evil.npz", a=objects)
        shutil.move(folder / f"evil.{kind}", folder / "evil.bin")
    (folder / "c.toml").write_text(SMALL)
    if role in ("sky", "network"):
        old, new = PLACES["image" if role == "sky" else "network"]
        (folder / "c.toml").write_text(SMALL.replace(old, new.format("evil.bin")))
    elif role != "campaign":
        assert command("simulate", "c.toml", "--out", "field.fits").code == 0
    words = {
        "image": ("detect", "evil.bin", "--out", "o.fits"),
        "exposure": ("detect", "field.fits", "--exposure", "evil.bin", "--out", "o.fits"),
        "background": ("detect", "field.fits", "--background", "evil.bin", "--out", "o.fits"),
        "campaign": ("validate", "evil.bin"),
        "regions": ("status", "evil.bin"),
    }.get(role, ("run", "c.toml", "--serial"))

    assert command(*words).code == 2


@pytest.mark.parametrize("payload", PAYLOADS[::3], ids=lambda payload: ascii(payload[:40]))
def test_an_option_is_never_code(canary: Path, payload: str) -> None:
    (canary.parent / "c.toml").write_text(SMALL)
    (canary.parent / "field.fits").write_bytes(b"SIMPLE")
    for words in (
        ("detect", "field.fits", "--method", payload, "--out", "o.fits"),
        ("detect", "field.fits", "--profile", payload, "--out", "o.fits"),
        ("detect", "field.fits", "--set", f"fwhm_arcsec={payload}", "--out", "o.fits"),
        ("detect", "field.fits", "--set", payload, "--out", "o.fits"),
        ("check-detector", payload),
        ("show", payload),
    ):
        assert command(*words).code == 2


# What turns data into code, or hands it to a shell. External programs go through survey_mc.external alone, and the
# engine starts its own interpreter.
FORBIDDEN_CALLS = {"eval", "exec", "compile", "__import__", "breakpoint", "input"}
FORBIDDEN_METHODS = {
    "system", "popen", "spawnl", "spawnv", "execv", "execl", "startfile", "loadtxt", "fromfile", "read_pickle",
    "to_pickle", "getoutput", "getstatusoutput", "mktemp", "unsafe_load", "full_load", "load_module", "exec_module",
    "run_path", "run_module", "read_hdf", "extractall", "urlopen", "urlretrieve", "eval",
}  # fmt: skip
FORBIDDEN_MODULES = {
    "pickle", "cPickle", "marshal", "shelve", "dill", "cloudpickle", "joblib", "yaml", "code", "codeop", "pty", "runpy",
    "imp", "urllib", "requests", "http", "ftplib", "telnetlib", "smtplib", "xmlrpc", "numexpr", "jinja2", "mako",
    "subprocess",
}  # fmt: skip
SUBPROCESS = {
    "survey_mc/external/program.py",
    "survey_mc/run/quarantine/isolated.py",
    "survey_mc/report/field_process.py",
}
ENTRY_POINTS = ("first", "self.plugins")  # of installed packages, by their names alone
PACKAGE = Path(survey_mc.__file__).parent


def dangers(source: ast.Module) -> Iterator[str]:
    """What a module does that could execute data."""
    for node in ast.walk(source):
        if isinstance(node, ast.Import | ast.ImportFrom):
            names = [alias.name for alias in node.names] if isinstance(node, ast.Import) else [node.module or ""]
            yield from (
                f"imports {name}" for name in names if name.partition(".")[0] in FORBIDDEN_MODULES | {"subprocess"}
            )
        elif isinstance(node, ast.Call):
            called = node.func
            if isinstance(called, ast.Name) and called.id in FORBIDDEN_CALLS:
                yield f"calls {called.id}"
            elif isinstance(called, ast.Attribute) and called.attr in FORBIDDEN_METHODS:
                yield f"calls .{called.attr}"
            elif isinstance(called, ast.Attribute) and called.attr in ("load", "loads"):
                of = ast.unparse(called.value)
                if of not in ("json", "tomllib", *ENTRY_POINTS):
                    yield f"calls {of}.{called.attr}"
            for keyword in node.keywords:
                if (
                    keyword.arg in ("shell", "allow_pickle", "use_unsafe_yaml")
                    and ast.unparse(keyword.value) != "False"
                ):
                    yield f"passes {keyword.arg}"


def test_the_scan_sees_what_it_looks_for() -> None:
    imports = "import pickle, os\nfrom yaml import load\nimport subprocess\n"
    calls = "os.system(x)\neval(y)\nnp.load(p, allow_pickle=True)\nrun(shell=True)"

    assert len(list(dangers(ast.parse(imports + calls)))) == 8


@cache
def sources() -> dict[str, ast.Module]:
    return {
        path.relative_to(PACKAGE.parent).as_posix(): ast.parse(path.read_text(encoding="utf-8"))
        for path in sorted(PACKAGE.rglob("*.py"))
    }


def test_no_source_file_turns_data_into_code() -> None:
    found = {(name, danger) for name, source in sources().items() for danger in dangers(source)}

    assert len(sources()) > 200
    assert found == {(name, "imports subprocess") for name in SUBPROCESS}


def test_no_interpreter_is_started_that_imports_from_the_current_folder() -> None:
    started = [
        (name, {element.value for element in node.elts if isinstance(element, ast.Constant)})
        for name, source in sources().items()
        for node in ast.walk(source)
        if isinstance(node, ast.List) and node.elts and ast.unparse(node.elts[0]) == "sys.executable"
    ]

    assert len(started) >= 3
    assert [name for name, options in started if not options & {"-I", "-P"}] == []
