"""R7, R18: one hash for every way to run a campaign, for all procedures.

Serial, 1, 2 and 4 workers and a worker with 4 threads; 1, 7 and 64 fields an order; three PYTHONHASHSEEDs; locales with
comma decimals, time zones, and (where libfaketime is installed) a clock that jumps. Several minutes.
"""

from __future__ import annotations

import argparse
import itertools
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

from fault_tools import cluster, environment, finish, hashes, start, verdict, write_campaign

from survey_mc.detect import DETECTORS


def every_procedure() -> str:
    """All built-in procedures but the one of the small campaign, and a second profile of each that has one."""
    text = ""
    for detector in DETECTORS.built_in:
        for profile in detector.profiles:
            text += (
                f'\n[[method]]\nname = "{detector.name}"\nlabel = "{detector.name} {profile}"\nprofile = "{profile}"\n'
            )
    return text


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--fields", type=int, default=8, help="realisations")
    chosen = parser.parse_args()
    found: dict[str, dict[str, str]] = {}
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch)
        campaign = write_campaign(folder, chosen.fields, per_file=5, extra=every_procedure())

        def book(name: str, *options: str, **variables: str) -> None:
            root = folder / name
            code, said = finish(start(campaign, root, *options, "--no-report", env=environment(**variables)))
            found[name] = hashes(root, tables=False) if code == 0 else {"failed": said}
            shutil.rmtree(root, ignore_errors=True)
            print(name, "done", file=sys.stderr)

        where = {"serial": ("--serial",)} | {f"{n} workers": ("--workers", str(n)) for n in (1, 2, 4)}
        seeds = itertools.cycle(("0", "1", "4294967295"))
        for (name, options), block in itertools.product(where.items(), (1, 7, 64)):
            book(f"{name}, block {block}", *options, "--block", str(block), PYTHONHASHSEED=next(seeds))
        with cluster(folder, 1, threads=4) as (file, _):
            book("threads", "--scheduler-file", file, "--block", "1")
        book("locale", "--serial", LC_ALL="de_DE.UTF-8", LANG="de_DE.UTF-8", TZ="Pacific/Kiritimati")
        book("other zone", "--workers", "2", LC_ALL="C", TZ="America/St_Johns")
        library = subprocess.run(["find", "/usr/lib", "-name", "libfaketime.so.1"], capture_output=True, text=True)
        if library.stdout.strip():
            book("clock", "--serial", LD_PRELOAD=library.stdout.split()[0], FAKETIME="-3000d x5")
    first = next(iter(found.values()))
    other = [name for name, result in found.items() if result != first]
    for name in other:
        print(name, found[name].get("failed", "differs"), file=sys.stderr)
    n_hashes = len({str(sorted(result.items())) for result in found.values()})
    figure = f"R7, R18 ways to run {len(DETECTORS.built_in)} procedures"
    return verdict(figure, f"{len(found)} ways, {n_hashes} hash", "1 hash", not other)


if __name__ == "__main__":
    sys.exit(main())
