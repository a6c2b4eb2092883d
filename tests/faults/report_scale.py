"""R19, R20 of the reading side: memory and time of report, status, plan and opening at 100 000 realisations of a cell.

The fields are those of a small run, stored over and over, so that only reading takes time; a tenth of them failed in
their procedure. Each verb has a process of its own, whose largest resident memory is read; what it starts in turn (the
report has one field drawn apart) is not in it. About 4 minutes for 100 000 fields.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path

from big_run import make_big_run
from fault_tools import COMMAND, environment, verdict

FEW = 1_000
MB = 1024.0  # kilobytes
MEMORY_MB, SLOPE_KB, SECONDS = 300.0, 1.0, 3.0
OPEN = [sys.executable, "-c", "import sys, survey_mc; print(len(survey_mc.open_run(sys.argv[1]).journal()))"]
ALLOWED = (0, 3)  # 3: fields have failed


@dataclass(frozen=True)
class Usage:
    """CPU seconds of a process and of what it started, and its own largest memory."""

    cpu_s: float
    peak_mb: float


def used(*command: str) -> Usage:
    process = subprocess.Popen(command, env=environment(), stdout=subprocess.DEVNULL)
    status, peak_kb = Path(f"/proc/{process.pid}/status"), 0
    while True:
        lines = status.read_text().splitlines()
        peak_kb = max([peak_kb, *(int(line.split()[1]) for line in lines if line.startswith("VmHWM"))])
        pid, code, usage = os.wait4(process.pid, os.WNOHANG)
        if pid:
            break
        time.sleep(0.02)
    process.returncode = os.waitstatus_to_exitcode(code)
    assert process.returncode in ALLOWED, command
    return Usage(usage.ru_utime + usage.ru_stime, peak_kb / MB)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--n", type=int, default=100_000, help=f"realisations, more than {FEW}")
    parser.add_argument("--failures", type=int, help="fields that failed, default a tenth of them")
    parser.add_argument("--out", type=Path, help="keep the run directory there")
    chosen = parser.parse_args()
    n, missed = chosen.n, 0
    n_failures = n // 10 if chosen.failures is None else chosen.failures
    with tempfile.TemporaryDirectory() as scratch:
        few = make_big_run(Path(scratch) / "few", FEW, n_failures=FEW * n_failures // n)
        many = make_big_run(chosen.out or Path(scratch) / "many", n, n_failures=n_failures)
        for name, verb, bar_s in (
            ("open", lambda root: [*OPEN, str(root)], SECONDS),
            ("status", lambda root: [*COMMAND, "status", str(root)], SECONDS),
            ("plan", lambda root: [*COMMAND, "plan", str(root / "campaign.toml"), "--out", str(root)], SECONDS),
            ("report", lambda root: [*COMMAND, "report", str(root)], float("inf")),
        ):
            small, large = used(*verb(few)), used(*verb(many))
            slope_kb = (large.peak_mb - small.peak_mb) * MB / (n - FEW)
            kept = large.peak_mb < MEMORY_MB and slope_kb < SLOPE_KB and large.cpu_s < bar_s
            bar = f"< {MEMORY_MB:.0f} MB, < {SLOPE_KB:g} kB a field" + (f", < {bar_s:g} s" if bar_s < 1e9 else "")
            shown = (
                f"{large.peak_mb:.0f} MB ({small.peak_mb:.0f} at {FEW}), {slope_kb:.2f} kB a field, {large.cpu_s:.1f} s"
            )
            missed |= verdict(f"R19, R20 {name}, {n} fields, {n_failures} failed", shown, bar, kept)
    return missed


if __name__ == "__main__":
    sys.exit(main())
