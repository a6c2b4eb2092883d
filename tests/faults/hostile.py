"""Hostile input and misbehaving programs, measured: code in campaigns, bombs, detectors that wrap a bad program.

R24  every payload in every place of a campaign, and a run with a worker in a folder full of modules with the names of
     ours: a canary must stay untouched.
R25  every bomb is given to a process of its own: refused with exit code 2, with less than 500 MB at its largest, and
     less than 2 s of CPU beyond what the same command takes over a harmless input (imports, most of all).
R26  the report of a run whose lock file, campaign and stored tables hold markup, pickles and foreign types: inert.
R28  ten programs that hang, flood, crash or lie, wrapped as a detector: each a failed field with the cause, the other
     method done, no process left, and no more memory than before.

About 5 minutes on one core; --quick takes every fifth payload and bomb.
"""

from __future__ import annotations

import argparse
import json
import os
import resource
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path

ROOT = Path(__file__).parents[2]
for folder in (ROOT / "tests", ROOT / "tests" / "safety", ROOT):
    sys.path.insert(0, str(folder))

import wrapped  # noqa: E402
from bombs import BOMBS  # noqa: E402
from command import command  # noqa: E402
from payloads import PAYLOADS, PLACES, TEMPTING_NAMES, campaigns_with, launcher  # noqa: E402
from programs import FAULTS, install  # noqa: E402
from small_campaigns import TEXT  # noqa: E402
from test_safety_store import HOSTILE, TAMPERED, assert_inert, hostile_lock, put_piece  # noqa: E402

from survey_mc.detect import DETECTORS  # noqa: E402

SECONDS, MEGABYTES = 2.0, 500.0
MORE_MEGABYTES = 50.0  # while one program prints without end; the first run also imports
MEASURED = """import re, sys, time
from survey_mc.cli import main
try:
    main(sys.argv[2:])
finally:
    peak_kb = re.search(r"VmHWM:\\s*(\\d+)", open("/proc/self/status").read())[1]
    open(sys.argv[1], "w").write(f"{time.process_time()} {peak_kb}")
"""
SMALL = TEXT.replace("realisations = 6", "realisations = 2").replace("n_pix = 128", "n_pix = 64")
ONE = SMALL.replace("realisations = 2", "realisations = 1")
WRAPPED = '\n[[method]]\nname = "brightpix"\nlabel = "B"\nparams = { timeout_s = TIMEOUT, counts_min = 3 }\n'
MEGABYTES_PRINTED = 1000


def environment() -> dict[str, str]:
    return os.environ | {"PYTHONPATH": str(ROOT), "OMP_NUM_THREADS": "1"}


def code_execution(folder: Path, every: int) -> bool:
    """R24: payloads as text, and modules in the current folder."""
    work = folder / "code"
    work.mkdir()
    canary = work / "CANARY"
    made = f"open({str(canary)!r}, 'a').write('x')\nraise ImportError\n"
    os.chdir(work)
    (work / "evil.py").write_text(made)
    n_touched = n_tried = 0
    for payload in PAYLOADS[::every]:
        for text in campaigns_with(payload, SMALL):
            (work / "c.toml").write_text(text)
            answer = command("validate", "c.toml")
            n_tried += 1
            n_touched += canary.exists() or "Traceback" in answer.err or answer.code not in (0, 2)
            canary.unlink(missing_ok=True)
    for name in TEMPTING_NAMES:
        (work / f"{name}.py").write_text(made)
    (work / "c.toml").write_text(SMALL)
    for words in (("validate", "c.toml"), ("run", "c.toml", "--workers", "1", "--no-report", "--out", "run")):
        done = subprocess.run(
            [*launcher(folder), *words], cwd=work, env=environment(), capture_output=True, check=False
        )
        n_tried += 1
        n_touched += canary.exists() or done.returncode != 0
        canary.unlink(missing_ok=True)
    print(
        f"R24 code: {len(PAYLOADS[::every])} payloads in {len(PLACES)} places, {len(TEMPTING_NAMES)} modules in the "
        f"current folder: {n_tried} tries, {n_touched} touched the canary or failed otherwise; bar 0"
    )
    return n_touched == 0


def bombs(folder: Path, every: int) -> bool:
    """R25: time and memory of each refusal."""
    (folder / "good.toml").write_text(SMALL)
    command("simulate", folder / "good.toml", "--out", folder / "good.fits")
    image = ("detect", folder / "good.fits", "--method", "gauss_se", "--overwrite", "--out", folder / "found.fits")
    usual_s = {
        words[0]: min(measured(folder, words)[2] for _ in range(3))
        for words in (("validate", folder / "good.toml"), image)
    }
    most_s = largest_mb = 0.0
    n_bad = 0
    chosen = list(BOMBS.items())[::every]
    for name, (build, word) in chosen:
        words = build(Path(tempfile.mkdtemp(dir=folder)))
        code, said, spent_s, peak_mb = measured(folder, words)
        more_s = spent_s - usual_s[words[0]]
        most_s, largest_mb = max(most_s, more_s), max(largest_mb, peak_mb)
        if code != 2 or word not in said or more_s > SECONDS or peak_mb > MEGABYTES:
            n_bad += 1
            print(f"  {name}: exit code {code}, {more_s:.2f} s, {peak_mb:.0f} MB: {said.strip()[:160]}")
    print(
        f"R25 bombs: {len(chosen)} tried, {len(chosen) - n_bad} refused by their limit; at most {most_s:.2f} s of CPU "
        f"more than usual and {largest_mb:.0f} MB; bar all, {SECONDS:g} s, {MEGABYTES:g} MB"
    )
    return n_bad == 0


def measured(folder: Path, words: Sequence[object]) -> tuple[int, str, float, float]:
    """Exit code, what it said, CPU seconds and largest memory (MB) of a command in a process of its own."""
    script, figures = folder / "measured.py", folder / "figures.txt"
    script.write_text(MEASURED)
    done = subprocess.run(
        [sys.executable, str(script), str(figures), *map(str, words)],
        env=environment(),
        cwd=folder,
        capture_output=True,
        check=False,
    )
    spent_s, peak_kb = figures.read_text().split()
    return done.returncode, done.stderr.decode(errors="replace"), float(spent_s), float(peak_kb) / 1024.0


def stores(folder: Path, every: int) -> bool:
    """R26: pages and answers of hostile run directories."""
    work = folder / "store"
    work.mkdir()
    os.chdir(work)
    legal = f'label = "G"\nprofile = "paper"\n[[method]]\nname = "gauss_se"\nlabel = {json.dumps(HOSTILE[:80])}'
    about = f"seed = 7\nabout = {json.dumps(HOSTILE)}"
    (work / "legal.toml").write_text(ONE.replace('label = "G"', legal).replace("seed = 7", about) + f"\n# {HOSTILE}\n")
    (work / "c.toml").write_text(ONE)
    command("run", "c.toml", "--serial", "--no-report", "--out", "good")
    cases: dict[str, Callable[[Path], object]] = {"a lock file full of markup": hostile_lock}
    cases |= {name: partial(put_piece, name="matches", change=change) for name, change in TAMPERED.items()}
    n_bad = n_pages = 0
    for name, tamper in {"a campaign full of markup": None, **cases}.items():
        shutil.rmtree(work / "run", ignore_errors=True)
        if tamper is None:
            answer = command("run", "legal.toml", "--serial", "--out", "run")
        else:
            shutil.copytree(work / "good", work / "run")
            tamper(work / "run")
            answer = command("report", "run")
        try:
            assert answer.code in (0, 4)
            assert "Traceback" not in answer.err
            assert not (work / "CANARY").exists()
            if answer.code == 0:
                n_pages += 1
                assert_inert((work / "run" / "report" / "index.html").read_text(encoding="utf-8"))
        except AssertionError as problem:
            n_bad += 1
            print(f"  {name}: exit code {answer.code}: {answer.err.strip()[:160]} {str(problem)[:160]}")
    print(
        f"R26 stores: {len(cases) + 1} hostile run directories, {n_bad} not inert; {n_pages} pages without script, "
        "link to elsewhere or request, the others refused as damaged; bar 0"
    )
    return n_bad == 0


def programs(folder: Path, every: int) -> bool:
    """R28: programs that misbehave, one run each."""
    DETECTORS._entries["brightpix"] = wrapped.DETECTOR
    path = os.environ["PATH"]
    n_bad, slowest_s = 0, 0.0
    for n_done, (name, (code, sentence)) in enumerate(FAULTS.items()):
        work = Path(tempfile.mkdtemp(dir=folder))
        os.environ["PATH"] = install(work, code, MEGABYTES_PRINTED)
        timeout_s = 0.5 if "0.5 s" in sentence else 60.0
        (work / "c.toml").write_text(SMALL + WRAPPED.replace("TIMEOUT", str(timeout_s)))
        before_kb = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
        start = time.monotonic()
        answer = command("run", work / "c.toml", "--serial", "--no-report", "--out", work / "run")
        spent_s = time.monotonic() - start
        slowest_s = max(slowest_s, spent_s)
        grown_mb = (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before_kb) / 1024.0
        failures = json.loads(command("status", work / "run", "--json").out)["failures"]
        caught = len(failures) == 2 and all(f["method"] == "B" and sentence in f["error"] for f in failures)
        left = [p for p in Path("/proc").glob("[0-9]*") if _has(p, str(work))]
        if answer.code != 3 or not caught or left or (grown_mb > MORE_MEGABYTES and n_done):
            n_bad += 1
            print(f"  {name}: exit code {answer.code}, {len(left)} processes left, {grown_mb:.0f} MB more")
    os.environ["PATH"] = path
    print(
        f"R28 programs: {len(FAULTS)} misbehave, {len(FAULTS) - n_bad} are failed fields with their cause and leave "
        f"nothing; slowest run {slowest_s:.1f} s (with {MEGABYTES_PRINTED} MB printed at a time); bar all"
    )
    return n_bad == 0


def _has(process: Path, word: str) -> bool:
    try:
        state = (process / "stat").read_text().rpartition(")")[2].split()[0]
        words = (process / "environ").read_bytes() + (process / "cmdline").read_bytes()
    except OSError:
        return False
    return state != "Z" and int(process.name) != os.getpid() and word.encode() in words


FIGURES: dict[str, Callable[[Path, int], bool]] = {
    "R24": code_execution,
    "R25": bombs,
    "R26": stores,
    "R28": programs,
}


def main() -> int:
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("--only", choices=FIGURES, help="one figure")
    options.add_argument("--quick", action="store_true", help="every fifth payload and bomb")
    chosen = options.parse_args()
    here = Path.cwd()
    met = True
    with tempfile.TemporaryDirectory(prefix="hostile-") as folder:
        for name, measure in FIGURES.items():
            if chosen.only in (None, name):
                met &= measure(Path(folder), 5 if chosen.quick else 1)
        os.chdir(here)
    return 0 if met else 1


if __name__ == "__main__":
    sys.exit(main())
