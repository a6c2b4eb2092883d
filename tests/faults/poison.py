"""R4: six fields of 200 that take their process down or never end; exactly those may be missing at the end.

Also without faults, for the time that the six cost. A minute or two.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
import time
from pathlib import Path

from fault_tools import finish, start, verdict, write_campaign
from faulty_detector import METHOD, environment, install_faulty, plant

from survey_mc.campaign import load_campaign
from survey_mc.run.status.state import run_status

TIMEOUT_S = 5.0
FAULTS = {17: "segfault", 40: "exit", 77: "loop", 101: "memory", 150: "exception", 199: "sys.exit"}
CAUSES = {17: "crash", 40: "crash", 77: "timeout", 101: "memory", 150: "exception", 199: "exception"}


def main() -> int:
    argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter).parse_args()
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch)
        install_faulty(folder)
        path = write_campaign(folder, 200, extra=METHOD)
        options = ("--workers", "2", "--block", "1", "--field-timeout", str(TIMEOUT_S), "--no-report")
        took_s = {}
        for name, faults in (("clean", {}), ("poisoned", FAULTS)):
            env = environment(folder)
            plant_in(folder, path, faults)
            begun = time.monotonic()
            code, said = finish(start(path, folder / name, *options, env=env))
            took_s[name] = time.monotonic() - begun
        state = run_status(folder / "poisoned")
        found = {failure["realisation"]: failure["cause"] for failure in state.failures}
        replayable = all(str(failure["replay"]).startswith("survey-mc replay") for failure in state.failures)
        done = {(method, n_done) for _, method, n_done, _ in state.rows}
    overhead_s = took_s["poisoned"] - took_s["clean"]
    if found != CAUSES:
        print(found, said, file=sys.stderr)
    # One order is lost to each of the three that kill; a worker is back in some seconds, and so is the trial alone.
    kept = code == 3 and found == CAUSES and replayable and done == {("F", 194), ("G", 200)}
    measured = f"{len(found)} of 6, exit {code}, {overhead_s:.0f} s more than the {took_s['clean']:.0f} s without"
    return verdict("R4 poisoned fields in quarantine", measured, "exactly 6 with cause and replay, exit 3", kept)


def plant_in(folder: Path, path: Path, faults: dict[int, str]) -> None:
    """Plant with the package on the path, so that the campaign that names it can be read here."""
    sys.path.insert(0, str(folder))
    plant(folder, load_campaign(path), faults)


if __name__ == "__main__":
    sys.exit(main())
