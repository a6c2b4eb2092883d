"""R16: two drivers started at once on one run directory, and lock files of dead processes and of other hosts.

About 10 s a trial.
"""

from __future__ import annotations

import argparse
import json
import sys
import tempfile
from pathlib import Path

from fault_tools import finish, hashes, reference, start, verdict, write_campaign

from survey_mc.store import RunLayout


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--n", type=int, default=10, help="trials")
    chosen = parser.parse_args()
    one_each = equal = reclaimed = 0
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch)
        campaign = write_campaign(folder, 48)
        wanted = reference(campaign, folder / "reference", "--serial", "--no-report")
        for trial in range(chosen.n):
            root = folder / f"run {trial}"
            both = [start(campaign, root, "--serial", "--no-report") for _ in range(2)]
            codes = sorted(finish(process)[0] for process in both)
            # Both may end well where the second came when the first had finished.
            one_each += codes in ([0, 5], [0, 0])
            equal += hashes(root, tables=False) == wanted
        for holder in ({"pid": 2**22 - 3, "host": "here"}, {"pid": 1, "host": "elsewhere.example"}):
            root = folder / f"stale {holder['host']}"
            root.mkdir()
            RunLayout(root).process_lock.write_text(json.dumps(holder))
            code, _ = finish(start(campaign, root, "--serial", "--no-report"))
            reclaimed += code == 0 and hashes(root, tables=False) == wanted
    measured = f"{one_each} of {chosen.n} with one writer, {equal} equal, {reclaimed} of 2 stale locks reclaimed"
    return verdict("R16 two drivers in one run directory", measured, "all, all, 2",
                   one_each == equal == chosen.n and reclaimed == 2)  # fmt: skip


if __name__ == "__main__":
    sys.exit(main())
