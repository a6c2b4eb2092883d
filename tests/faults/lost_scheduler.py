"""R5: a dask scheduler started by hand is killed at a random time of a run; the driver must leave with one sentence.

Then scheduler and workers are started anew and the run goes on. About 30 s a trial.
"""

from __future__ import annotations

import argparse
import random
import signal
import sys
import tempfile
import time
from pathlib import Path

from fault_tools import cluster, finish, hashes, reference, start, verdict, write_campaign

WAITING = "has no workers yet; waiting"


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--n", type=int, default=5, help="trials")
    parser.add_argument("--seed", type=int, default=4)
    chosen = parser.parse_args()
    rng = random.Random(chosen.seed)
    clean = equal = 0
    slowest_s = 0.0
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch)
        campaign = write_campaign(folder, 400)
        wanted = reference(campaign, folder / "reference", "--no-report")
        for trial in range(chosen.n):
            root = folder / f"run {trial}"
            with cluster(folder) as (file, started):
                driver = start(campaign, root, "--scheduler-file", file, "--block", "2", "--no-report")
                time.sleep(4.0 + rng.uniform(0.0, 6.0))
                started["scheduler"].send_signal(signal.SIGKILL)
                lost = time.monotonic()
                code, said = finish(driver, 120.0)
                slowest_s = max(slowest_s, time.monotonic() - lost)
            # A driver that came before the first worker has said so before anything was lost.
            sentences = [line for line in said.splitlines() if line.startswith("survey-mc:") and WAITING not in line]
            good = code == 0 or (code == 2 and len(sentences) == 1 and "Traceback" not in said)
            clean += good
            if not good:
                print(code, said, file=sys.stderr)
            with cluster(folder) as (file, _):
                code, said = finish(start(campaign, root, "--scheduler-file", file, "--no-report"))
            same = code == 0 and hashes(root, tables=False) == wanted
            equal += same
            print(f"trial {trial}: {'equal' if same else said}", file=sys.stderr)
    measured = f"{clean} of {chosen.n} clean exits within {slowest_s:.0f} s, {equal} resumed to the same bytes"
    return verdict("R5 schedulers killed", measured, "all, all", clean == equal == chosen.n)


if __name__ == "__main__":
    sys.exit(main())
