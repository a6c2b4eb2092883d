"""R14: a disk that fills up (a small tmpfs, where mounting is allowed) and a limit on the size of files.

The run must leave with one sentence that says how much is needed, the store must be sound, and after space is made the
same command must end with the bytes of an undisturbed run. About a minute.
"""

from __future__ import annotations

import argparse
import resource
import subprocess
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path

from fault_tools import COMMAND, environment, finish, hashes, reference, start, verdict, write_campaign

SIZES = (6000, 12_000, 25_000)  # less than the lock file, more, and more than some stored files


def limited(size: int) -> Callable[[], None]:
    """Before the program starts: no file may grow beyond some bytes."""
    return lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (size, size))


def judge(code: int, said: str, root: Path) -> str:
    """What is wrong with how a run ended, empty if nothing is."""
    if code != 2:
        return f"exit {code}: {said}"
    sentence = [line for line in said.splitlines() if line.startswith("survey-mc:")]
    if len(sentence) != 1 or "cannot be written" not in sentence[0] or "bytes are free" not in sentence[0]:
        return f"said {said}"
    checked = subprocess.run(
        [*COMMAND, "verify", str(root)], env=environment(), capture_output=True, text=True, check=False
    )
    if "is not a run directory" in checked.stderr and not list(root.rglob("*.parquet")):
        return ""  # not even the lock file had room
    return "" if checked.returncode == 0 else f"verify: {checked.stdout}{checked.stderr}"


def filled(folder: Path, campaign: Path, wanted: dict[str, str], mega: int) -> str:
    """A run on a disk of some MB, which is then made larger."""
    disk = folder / f"disk {mega}"
    disk.mkdir()
    if subprocess.run(["mount", "-t", "tmpfs", "-o", f"size={mega}m", "tmpfs", str(disk)], check=False).returncode:
        return "mounting a tmpfs is not allowed here"
    try:
        root = disk / "run"
        wrong = judge(*finish(start(campaign, root, "--workers", "2", "--block", "4", "--no-report")), root)
        subprocess.run(["mount", "-o", "remount,size=200m", str(disk)], check=True)
        code, said = finish(start(campaign, root, "--workers", "2", "--no-report"))
        return wrong or ("" if code == 0 and hashes(root, tables=False) == wanted else f"after: exit {code}: {said}")
    finally:
        subprocess.run(["umount", str(disk)], check=False)


def file_limited(folder: Path, campaign: Path, wanted: dict[str, str], size: int) -> str:
    """A run whose files may have no more than some bytes each."""
    root = folder / f"limited {size}"
    command = [*COMMAND, "run", str(campaign), "--out", str(root), "--serial", "--no-report"]
    done = subprocess.run(
        command, env=environment(), capture_output=True, text=True, check=False, preexec_fn=limited(size)
    )
    wrong = judge(done.returncode, done.stdout + done.stderr, root)
    code, said = finish(start(campaign, root, "--serial", "--no-report"))
    return wrong or ("" if code == 0 and hashes(root, tables=False) == wanted else f"after: exit {code}: {said}")


def main() -> int:
    argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter).parse_args()
    missed = 0
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch)
        campaign = write_campaign(folder, 160)
        wanted = reference(campaign, folder / "reference", "--no-report")
        cases = {f"disk of {mega} MB": filled(folder, campaign, wanted, mega) for mega in (1, 2, 3)}
        cases |= {f"files of {size} bytes": file_limited(folder, campaign, wanted, size) for size in SIZES}
    for name, wrong in cases.items():
        missed |= verdict(f"R14 {name}", wrong or "one sentence, sound store, same bytes after", "the same", not wrong)
    return missed


if __name__ == "__main__":
    sys.exit(main())
