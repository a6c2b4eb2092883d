"""Item "cost model": what `plan` predicts against what the run then takes, for five kinds of work.

Each campaign is planned in a fresh process, run with two workers, and its journal, files and clock are compared with
the plan. Wall times are judged only where nothing else keeps the machine busy. About 5 minutes on two cores.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from fault_tools import MR1, ROOT, TEXT, environment, verdict

from survey_mc.campaign import load_campaign
from survey_mc.run import open_run, plan_campaign, run_campaign
from survey_mc.run.executors import ExecutorChoice

WORKERS = 2
BAR = 0.30
QUIET_SHARE, QUIET_SECONDS = 0.9, 2.0  # of the cores are idle, just before
TEST_5 = """
schema = 1
name = "piece"
seed = 4
method = [{ name = "gauss_se" }, { name = "mr1_se" }, { name = "wavdetect" }]
instrument = { name = "xmm_epic" }
sky = { kind = "lognlogs", model = { soft = "hasinger1998" }, flux_min_cgs = 1e-16 }
grid = { band = ["soft"], exposure_ks = [10.0, 100.0], realisations = 8 }
match = { counts_min = { 10 = 10, 100 = 30 }, counts_min_on = "counts_onaxis" }
"""


@dataclass(frozen=True)
class Taken:
    """CPU seconds, wall seconds, bytes and files of a piece of work."""

    cpu_s: float
    wall_s: float
    size_bytes: int
    files: int


def stored(root: Path) -> tuple[int, int]:
    files = list((root / "store").rglob("*.parquet"))
    return sum(path.stat().st_size for path in files), len(files)


def planned(campaign: Path, root: Path) -> tuple[Taken, str]:
    """The plan, made by a process that has done nothing yet, and where its costs come from."""
    command = [sys.executable, __file__, "--plan", str(campaign), "--out", str(root)]
    said = subprocess.run(command, env=environment(), capture_output=True, text=True, check=True).stdout
    content = json.loads(said)
    return Taken(*content["taken"]), content["measured"]


def print_plan(campaign: Path, root: Path) -> None:
    plan = plan_campaign(load_campaign(campaign), root, WORKERS)
    joined_s = plan.stages.get(("", "pack"), 0.0)  # is the driver's and in no journal
    taken = (plan.cpu_s - joined_s, plan.wall_s(WORKERS), plan.size_bytes, plan.new_files)
    print(json.dumps({"taken": taken, "measured": plan.measured}))


def done(campaign: Path, root: Path) -> Taken:
    bytes_before, files_before = stored(root)
    journals_before = set(root.glob("runs/*.jsonl"))
    begun = time.monotonic()
    run_campaign(load_campaign(campaign), root, ExecutorChoice(workers=WORKERS))
    wall_s = time.monotonic() - begun
    (mine,) = set(root.glob("runs/*.jsonl")) - journals_before
    journal = open_run(root).journal()
    cpu_s = float(journal.loc[journal["started"] == mine.stem, "cpu_s"].sum())
    bytes_after, files_after = stored(root)
    return Taken(cpu_s, wall_s, bytes_after - bytes_before, files_after - files_before)


def works(folder: Path) -> Iterator[tuple[str, Path, Path]]:
    """Name, campaign and run directory of each piece of work; a later one may build on the run of an earlier one."""
    small = TEXT.replace("realisations_per_file = 4", "realisations_per_file = 64")
    tiny = small.replace("n_pix = 128", "n_pix = 64").replace("realisations = 6", "realisations = 1000")
    grown = small.replace("realisations = 6", "realisations = 300")
    for name, text, run in (
        ("smoke", (ROOT / "campaigns" / "smoke.toml").read_text(), "smoke"),
        ("a piece of Test 5", TEST_5, "piece"),
        ("tiny fields", tiny, "tiny"),
        ("small fields", small.replace("realisations = 6", "realisations = 100"), "small"),
        ("growth and a new method", grown + MR1, "small"),
        ("another radius", (grown + MR1).replace("[match]", "[match]\nradius_arcsec = 8.0"), "small"),
    ):
        path = folder / f"{name.replace(' ', '_')}.toml"
        path.write_text(text)
        yield name, path, folder / run


def idle_share() -> float:
    """Share of the machine's CPU time of the next seconds that nobody uses."""

    def ticks() -> list[int]:
        return [int(word) for word in Path("/proc/stat").read_text().split("\n", 1)[0].split()[1:9]]

    before = ticks()
    time.sleep(QUIET_SECONDS)
    spent = [now - then for now, then in zip(ticks(), before, strict=True)]
    return (spent[3] + spent[4]) / max(sum(spent), 1)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--only", help="part of the name of the works to do; later ones may need earlier ones")
    parser.add_argument("--plan", type=Path, help=argparse.SUPPRESS)
    parser.add_argument("--out", type=Path, help=argparse.SUPPRESS)
    chosen = parser.parse_args()
    if chosen.plan:
        print_plan(chosen.plan, chosen.out)
        return 0
    missed = 0
    with tempfile.TemporaryDirectory() as scratch:
        for name, campaign, root in works(Path(scratch)):
            if chosen.only and chosen.only not in name:
                continue
            is_quiet = idle_share() > QUIET_SHARE
            foretold, measured = planned(campaign, root)
            truth = done(campaign, root)
            for what, unit in (("cpu_s", "s"), ("wall_s", "s"), ("size_bytes", "bytes"), ("files", "files")):
                said, was = getattr(foretold, what), getattr(truth, what)
                ratio = said / was if was else float(said == was)
                if what == "wall_s" and not is_quiet:
                    print(f"plan of {name}, {what}: {said:.4g} of {was:.4g} {unit}; not judged, the machine is busy")
                    continue
                kept = 1 - BAR <= ratio <= 1 + BAR
                label, shown = f"plan of {name} ({measured}), {what}", f"{said:.4g} of {was:.4g} {unit}, {ratio:.2f}"
                missed |= verdict(label, shown, f"within {BAR:.0%}", kept)
    return missed


if __name__ == "__main__":
    sys.exit(main())
