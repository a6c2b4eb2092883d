"""R2, R3: SIGKILL a random worker every 1 to 3 s during 500 orders; nothing may be lost, doubled or blamed.

Two workers, one field an order. A worker needs some seconds to come back, so this takes several minutes.
"""

from __future__ import annotations

import argparse
import os
import random
import signal
import sys
import tempfile
import time
from pathlib import Path

from fault_tools import finish, hashes, reference, start, verdict, worker_pids, write_campaign

from survey_mc.run import open_run
from survey_mc.run.status.state import run_status


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--n", type=int, default=500, help="orders")
    parser.add_argument("--seed", type=int, default=2)
    chosen = parser.parse_args()
    rng = random.Random(chosen.seed)
    kills = 0
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch)
        campaign = write_campaign(folder, chosen.n)
        wanted = reference(campaign, folder / "reference", "--no-report")
        root = folder / "run"
        begun = time.monotonic()
        driver = start(campaign, root, "--workers", "2", "--block", "1", "--no-report")
        while driver.poll() is None:
            time.sleep(rng.uniform(1.0, 3.0))
            workers = worker_pids(driver.pid)
            if workers and driver.poll() is None:
                os.kill(rng.choice(workers), signal.SIGKILL)
                kills += 1
        code, said = finish(driver)
        took_s = time.monotonic() - begun
        same = hashes(root, tables=False) == wanted
        truth = open_run(root).truth()
        doubled = int(truth.duplicated(["cell", "realisation", "source_id"]).sum())
        lost = chosen.n - truth["realisation"].nunique()
        blamed = run_status(root).n_failed
        if code:
            print(said, file=sys.stderr)
    missed = verdict(f"R2 {chosen.n} orders under {kills} worker deaths in {took_s:.0f} s",
                     f"exit {code}, {lost} lost, {doubled} rows doubled, files {'equal' if same else 'differ'}",
                     "exit 0, 0 lost, 0 doubled, equal", code == 0 and not lost and not doubled and same)  # fmt: skip
    return missed | verdict("R3 innocent orders blamed", f"{blamed}", "0", blamed == 0)


if __name__ == "__main__":
    sys.exit(main())
