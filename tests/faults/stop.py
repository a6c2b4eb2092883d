"""R17: SIGINT and SIGTERM at random times of a run: how long it takes to stop, what is left, what the next run finds.

About 15 s a trial.
"""

from __future__ import annotations

import argparse
import random
import signal
import sys
import tempfile
import time
from pathlib import Path

from fault_tools import alive, descendants, finish, hashes, reference, start, verdict, write_campaign

CODES = {signal.SIGINT: 130, signal.SIGTERM: 143}


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--n", type=int, default=20, help="trials")
    parser.add_argument("--seed", type=int, default=3)
    chosen = parser.parse_args()
    rng = random.Random(chosen.seed)
    slowest_s, wrong, orphaned, unequal, left = 0.0, [], 0, 0, 0
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch)
        campaign = write_campaign(folder, 96)
        begun = time.monotonic()
        wanted = reference(campaign, folder / "reference", "--workers", "2", "--block", "4", "--no-report")
        whole_s = time.monotonic() - begun
        for trial in range(chosen.n):
            root = folder / f"run {trial}"
            number = (signal.SIGINT, signal.SIGTERM)[trial % 2]
            driver = start(campaign, root, "--workers", "2", "--block", "4", "--no-report")
            # Before a second has passed the interpreter may still be importing, and dies of SIGTERM like any other.
            time.sleep(rng.uniform(0.15, 0.95) * whole_s)
            below = descendants(driver.pid)
            if driver.poll() is not None:
                continue
            sent = time.monotonic()
            driver.send_signal(number)
            code, said = finish(driver, 60.0)
            slowest_s = max(slowest_s, time.monotonic() - sent)
            if code not in (CODES[number], 0) or "Traceback" in said:
                wrong.append(f"{number.name} -> {code}: {said[-600:]}")
            time.sleep(1.0)
            orphaned += len(alive(below))
            code, said = finish(start(campaign, root, "--workers", "2", "--block", "4", "--no-report"))
            unequal += code != 0 or hashes(root, tables=False) != wanted
            left += sum(1 for path in (root / "store" / "tmp").glob("*")) + (root / "attempts").exists()
    for sentence in wrong:
        print(sentence, file=sys.stderr)
    measured = (
        f"{slowest_s:.1f} s at most, {len(wrong)} wrong exits, {orphaned} orphans, {left} leftovers after the next "
        f"run, {unequal} unequal"
    )
    return verdict(f"R17 {chosen.n} stops by SIGINT and SIGTERM", measured, "< 10 s, exit 130/143, 0, 0, 0",
                   slowest_s < 10.0 and not (wrong or orphaned or left or unequal))  # fmt: skip


if __name__ == "__main__":
    sys.exit(main())
