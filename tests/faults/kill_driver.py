"""R1, R6: SIGKILL the driver at random times, go on, compare every byte; count the work that is done twice.

Each trial starts a run (two workers and serial in turn), kills the driver, and runs it again to its end. Three of four
are killed when a random number of its files is stored and a random moment later, and their stored files compared; every
fourth at a random moment from the start of the program to the end of the report, and its tables are compared, too.
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

from fault_tools import finish, hashes, manifest_lines, reference, start, verdict, write_campaign

from survey_mc.run import open_run
from survey_mc.store import Manifest, Piece, RunLayout

REALISATIONS, BLOCK, WORKERS = 96, 4, 2
FILES = 7 * REALISATIONS // BLOCK  # that enter the manifest: truth, and three tables of each of two methods


def orphans(root: Path) -> int:
    """Orders whose files are on disk, whole or in part, and not in the manifest: work that is done again."""
    layout = RunLayout(root)
    if not layout.manifest.exists():
        return 0
    manifest = Manifest(layout.manifest)
    pieces = [Piece.from_path(path) for path in layout.piece_files()]
    strays = [piece for piece in pieces if piece is not None and piece not in manifest]
    return len({piece.start // BLOCK for piece in strays if piece.stop - piece.start <= BLOCK})


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--n", type=int, default=50, help="trials")
    parser.add_argument("--seed", type=int, default=1)
    chosen = parser.parse_args()
    rng = random.Random(chosen.seed)
    equal, killed, twice, redone = 0, 0, 0, 0
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch)
        campaign = write_campaign(folder, REALISATIONS)
        begun = time.monotonic()
        wanted = reference(campaign, folder / "reference", "--workers", str(WORKERS), "--block", str(BLOCK))
        whole_s = time.monotonic() - begun
        for trial in range(chosen.n):
            root = folder / f"run {trial}"
            where = ("--serial",) if trial % 2 else ("--workers", str(WORKERS))
            any_time = trial % 8 in (3, 4)  # one of them serial
            options = (*where, "--block", str(BLOCK), *(() if any_time else ("--no-report",)))
            driver = start(campaign, root, *options)
            if any_time:
                time.sleep(rng.uniform(0.05, 1.0) * whole_s)
            else:
                n_lines = rng.randrange(1, FILES)
                while driver.poll() is None and manifest_lines(root) < n_lines:
                    time.sleep(0.001)
                time.sleep(rng.uniform(0.0, 0.1))
            if driver.poll() is None:
                driver.send_signal(signal.SIGKILL)
                killed += 1
            finish(driver)
            before = journalled(root)
            redone = max(redone, orphans(root))
            code, said = finish(start(campaign, root, *options))
            wanted_here = wanted if any_time else {path: h for path, h in wanted.items() if "tables" not in path}
            same = code == 0 and hashes(root, tables=any_time) == wanted_here
            equal += same
            twice += max(0, journalled(root) - REALISATIONS)
            print(f"trial {trial}: {before} fields before the kill, {'equal' if same else said}", file=sys.stderr)
    kept = verdict("R1 runs equal after SIGKILL of the driver", f"{equal} of {chosen.n} ({killed} killed)", "all",
                   equal == chosen.n)  # fmt: skip
    kept |= verdict("R6 orders done again after a kill", f"at most {redone}; {twice} recorded fields done twice",
                    f"<= {2 * WORKERS} orders, 0 fields", redone <= 2 * WORKERS and twice == 0)  # fmt: skip
    return kept


def journalled(root: Path) -> int:
    """Fields that the journals of a run have as drawn."""
    try:
        costs = open_run(root).journal()
    except Exception:  # killed before there was a run directory
        return 0
    return int(costs[costs["stage"] == "draw"]["fields"].sum())


if __name__ == "__main__":
    sys.exit(main())
