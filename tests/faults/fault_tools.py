"""What the fault scripts share: campaigns, processes of a run, hashes of its results.

The scripts are run by hand, `python tests/faults/NAME.py --help`; each prints its figure beside its bar and leaves with
1 when the bar is missed.
"""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1]))
sys.path.insert(0, str(Path(__file__).parents[2]))

from small_campaigns import MR1, TEXT

from survey_mc.store import Manifest, RunLayout
from survey_mc.store.parquet import file_sha256

ROOT = Path(__file__).parents[2]
COMMAND = [sys.executable, "-c", "from survey_mc.cli import main; main()"]


def write_campaign(folder: Path, realisations: int, per_file: int = 16, extra: str = MR1) -> Path:
    """A campaign of 128-pixel fields that take some ten milliseconds each."""
    text = TEXT.replace("realisations = 6", f"realisations = {realisations}")
    path = folder / "small.toml"
    path.write_text(text.replace("realisations_per_file = 4", f"realisations_per_file = {per_file}") + extra)
    return path


def environment(**others: str) -> dict[str, str]:
    """Variables of a process that runs this checkout."""
    path = os.pathsep.join(p for p in (str(ROOT), os.environ.get("PYTHONPATH", "")) if p)
    return os.environ | {"PYTHONPATH": path, "OMP_NUM_THREADS": "1"} | others


def start(campaign: Path, root: Path, *options: str, env: dict[str, str] | None = None) -> subprocess.Popen[str]:
    """A driver in a process (and session) of its own."""
    return subprocess.Popen(
        [*COMMAND, "run", str(campaign), "--out", str(root), *options],
        env=env or environment(),
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        start_new_session=True,
    )


def finish(process: subprocess.Popen[str], timeout_s: float = 900.0) -> tuple[int, str]:
    """Exit code and output."""
    said, _ = process.communicate(timeout=timeout_s)
    return process.returncode, said


def hashes(root: Path, *, tables: bool = True) -> dict[str, str]:
    """SHA-256 of every stored file, the manifest and the tables."""
    paths = [root / path for path in RunLayout(root).piece_files()] + [root / "manifest.jsonl"]
    if tables:
        paths += sorted((root / "tables").glob("*"))
    return {str(path.relative_to(root)): file_sha256(path) for path in paths}


def reference(campaign: Path, root: Path, *options: str) -> dict[str, str]:
    """Hashes of a run that nothing disturbs."""
    code, said = finish(start(campaign, root, *options))
    assert code == 0, said
    return hashes(root, tables="--no-report" not in options)


def manifest_lines(root: Path) -> int:
    path = RunLayout(root).manifest
    return path.read_bytes().count(b"\n") if path.exists() else 0


def n_stored(root: Path) -> int:
    """Files in the manifest, packed parts left out."""
    return len(Manifest(RunLayout(root).manifest))


def processes() -> dict[int, tuple[int, str]]:
    """Parent and command line of every process."""
    found = {}
    for folder in Path("/proc").glob("[0-9]*"):
        try:
            parent = int((folder / "stat").read_text().rpartition(")")[2].split()[1])
            line = (folder / "cmdline").read_bytes().replace(b"\0", b" ").decode(errors="replace")
        except (OSError, ValueError):
            continue
        found[int(folder.name)] = (parent, line)
    return found


def descendants(pid: int) -> dict[int, str]:
    """Command lines of all processes below one."""
    every = processes()
    below: dict[int, str] = {}
    todo = [pid]
    while todo:
        parent = todo.pop()
        for child, (its_parent, line) in every.items():
            if its_parent == parent and child not in below:
                below[child] = line
                todo.append(child)
    return below


def worker_pids(driver: int) -> list[int]:
    """The processes of a local cluster that do the work."""
    return sorted(
        pid for pid, line in descendants(driver).items() if "spawn_main" in line and "resource_tracker" not in line
    )


def alive(pids: dict[int, str]) -> list[int]:
    """Those of some processes that are still there, by their command lines too."""
    now = processes()
    return [pid for pid, line in pids.items() if line and now.get(pid, (0, ""))[1] == line]


@contextmanager
def cluster(
    folder: Path, workers: int = 2, threads: int = 1, env: dict[str, str] | None = None
) -> Iterator[tuple[str, dict[str, subprocess.Popen[str]]]]:
    """A dask scheduler and its workers, started by hand on loopback; the scheduler file and the processes by name."""
    worker_env = env or environment()
    file = folder / f"scheduler-{time.monotonic_ns()}.json"
    python = [sys.executable, "-m", "distributed.cli.dask_scheduler"]
    worker = [sys.executable, "-m", "distributed.cli.dask_worker"]
    quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL, "env": environment(), "text": True}
    started: dict[str, subprocess.Popen[str]] = {}
    try:
        started["scheduler"] = subprocess.Popen(
            [*python, "--host", "127.0.0.1", "--port", "0", "--no-dashboard", "--scheduler-file", str(file)], **quiet
        )
        for number in range(workers):
            options = ["--host", "127.0.0.1", "--nthreads", str(threads), "--local-directory", str(folder)]
            started[f"worker {number}"] = subprocess.Popen(
                [*worker, "--scheduler-file", str(file), "--no-dashboard", *options], **(quiet | {"env": worker_env})
            )
        until = time.monotonic() + 60.0
        while not file.is_file() and time.monotonic() < until:
            time.sleep(0.05)
        yield str(file), started
    finally:
        for process in started.values():
            process.send_signal(signal.SIGTERM)
        for process in started.values():
            try:
                process.wait(20)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()


def verdict(figure: str, measured: str, bar: str, kept: bool) -> int:
    """Print one line and give the exit code."""
    print(f"{figure}: measured {measured}; bar {bar}; {'kept' if kept else 'MISSED'}")
    return 0 if kept else 1
