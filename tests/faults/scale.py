"""Item "scale", R19, R20: 100 000 realisations of a cell from plan to verify, with the memory and time of every step.

Fields of 64 pixels, so that it takes minutes and not hours; everything else is as in any campaign. The memory of driver
and workers is read once a second while the run goes on. About 15 minutes for 100 000 fields.
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

from fault_tools import COMMAND, environment, start, verdict, worker_pids, write_campaign

MB = 1024.0  # kilobytes
CHANGES = {"n_pix = 128": "n_pix = 64", "region_arcmin = 4.0": "region_arcmin = 2.0"}


@dataclass
class Peak:
    """Most memory (MB), and what it was when a tenth of the fields was done."""

    most: float = 0.0
    early: float = 0.0


def rss_mb(pid: int) -> float:
    try:
        lines = Path(f"/proc/{pid}/status").read_text().splitlines()
    except OSError:
        return 0.0
    return next((int(line.split()[1]) / MB for line in lines if line.startswith("VmRSS")), 0.0)


def just_said(pipe: int) -> str:
    """What a process has printed since the last time."""
    try:
        return os.read(pipe, 65536).decode(errors="replace")
    except BlockingIOError:
        return ""


def run(campaign: Path, root: Path, n: int, driver_peak: Peak, worker_peak: Peak) -> float:
    """Run the campaign without its report; seconds."""
    begun = time.monotonic()
    driver = start(campaign, root, "--workers", "2", "--no-report")
    assert driver.stdout is not None
    os.set_blocking(driver.stdout.fileno(), False)
    early = False
    while driver.poll() is None:
        for line in just_said(driver.stdout.fileno()).splitlines():
            done = line.partition(": ")[2].partition("/")[0]
            early |= done.isdigit() and int(done) >= n // 10
        for peak, found in ((driver_peak, rss_mb(driver.pid)),
                            (worker_peak, max(map(rss_mb, worker_pids(driver.pid)), default=0.0))):  # fmt: skip
            peak.most = max(peak.most, found)
            if not early:
                peak.early = peak.most
        time.sleep(1.0)
    assert driver.returncode == 0, just_said(driver.stdout.fileno())
    return time.monotonic() - begun


def verb(*arguments: str) -> tuple[float, float]:
    """Seconds and peak memory (MB) of a command."""
    begun = time.monotonic()
    with subprocess.Popen([*COMMAND, *arguments], env=environment(), stdout=subprocess.DEVNULL) as process:
        _, code, usage = os.wait4(process.pid, 0)
        process.returncode = os.waitstatus_to_exitcode(code)
    assert process.returncode == 0, arguments
    return time.monotonic() - begun, usage.ru_maxrss / MB


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--n", type=int, default=100_000, help="realisations")
    parser.add_argument("--out", type=Path, help="keep the run directory there")
    chosen = parser.parse_args()
    n, missed = chosen.n, 0
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch)
        campaign = write_campaign(folder, n, per_file=200, extra="")
        text = campaign.read_text()
        for old, new in CHANGES.items():
            assert old in text
            text = text.replace(old, new)
        campaign.write_text(text)
        root = chosen.out or folder / "run"
        plan_s, plan_mb = verb("plan", str(campaign), "--out", str(root))
        driver, worker = Peak(), Peak()
        run_s = run(campaign, root, n, driver, worker)
        files = sum(1 for path in (root / "store").rglob("*.parquet"))
        for figure, peak, bar in (("driver", driver, 300.0), ("worker", worker, 500.0)):
            slope_kb = (peak.most - peak.early) * MB / (0.9 * n)
            measured = f"{peak.most:.0f} MB ({peak.early:.0f} at a tenth, {slope_kb:.2f} kB a field)"
            kept = peak.most < bar and slope_kb < 1.0
            missed |= verdict(f"R19 {figure} of a run of {n} fields", measured, f"< {bar:.0f} MB, < 1 kB a field", kept)
        print(f"run: {run_s:.0f} s, {n / run_s:.0f} fields/s, {files} files", flush=True)
        again_s, again_mb = verb("run", str(campaign), "--out", str(root), "--no-report")
        steps = {
            "plan of nothing done": (plan_s, plan_mb, 3.0),
            "plan of all done": (*verb("plan", str(campaign), "--out", str(root)), 3.0),
            "status": (*verb("status", str(root)), 3.0),
            "run again": (again_s, again_mb, 3.0),
            "report": (*verb("report", str(root)), float("inf")),
            "verify": (*verb("verify", str(root), "--replay", "3"), float("inf")),
        }
        for name, (seconds, mega, bar_s) in steps.items():
            bar = "< 300 MB" + (f", < {bar_s:g} s" if bar_s < float("inf") else "")
            missed |= verdict(f"R20 {name}, {n} fields", f"{seconds:.1f} s, {mega:.0f} MB", bar,
                              mega < 300.0 and seconds < bar_s)  # fmt: skip
    return missed


if __name__ == "__main__":
    sys.exit(main())
