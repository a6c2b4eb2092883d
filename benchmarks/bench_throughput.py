"""Fields per second of a whole campaign, against what its procedure alone would allow; run by hand, on a quiet machine.

    OMP_NUM_THREADS=1 python benchmarks/bench_throughput.py [--fields 1280] [--workers 2] [--method gauss_se]

One procedure on soft 10 ks fields of `test5_completeness` with another seed: the campaign is run serially and with
workers, everything included (drawing, matching, committing), and the journals are read. "Alone" is the procedure called
by itself on the same fields, in this process. Prints, for both runs, CPU ms a field by stage, fields per second, and

    throughput   of the workers, over workers ÷ the procedure's own seconds a field             bar 0.85, stretch 0.92
    two workers  wall time of the run with workers over its share of the serial run (R34)         bar 1.15

Fields per second count from the end of the first order to that of the last, so that they do not depend on how many
fields share the start of the workers; the second figure has the start in it. With fewer than 1024 fields two workers
get orders of less than a whole file, whose parts are then packed: another figure. Exits with 1 where a bar is missed.
Takes about 0.12 s a field, and a minute more on a fresh install.
"""

from __future__ import annotations

import argparse
import re
import resource
import sys
import tempfile
import time
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path

from survey_mc.campaign import Campaign, draw_field, expand, parse_campaign
from survey_mc.detect import DETECTORS
from survey_mc.rng import stream
from survey_mc.run import open_run, run_campaign
from survey_mc.run.executors import ExecutorChoice
from survey_mc.run.stages import method_choice_params

CAMPAIGN = Path(__file__).parents[1] / "campaigns" / "test5_completeness.toml"
SEED = 77
FIELDS_ALONE = 64
THROUGHPUT_BAR, THROUGHPUT_STRETCH, SHARE_BAR = 0.85, 0.92, 1.15


@dataclass(frozen=True, slots=True)
class Measured:
    """A run: wall_s of all of it, cpu_ms of everything a field costs, stage_ms by stage, fields_per_s on the way."""

    wall_s: float
    cpu_ms: float
    stage_ms: dict[str, float]
    fields_per_s: float


def campaign_of(method: str, n_fields: int) -> Campaign:
    """Soft 10 ks fields of Test 5 with one procedure and another seed."""
    text = CAMPAIGN.read_text()
    for pattern, new in (
        (r"seed = \d+", f"seed = {SEED}"),
        (r"method = \[.*?\n\]", f'method = [{{ name = "{method}" }}]'),
        (r"band = \[.*?\]", 'band = ["soft"]'),
        (r"exposure_ks = \[.*?\]", "exposure_ks = [10.0]"),
        (r"realisations = \d+", f"realisations = {n_fields}"),
    ):
        text = re.sub(pattern, new, text, count=1, flags=re.DOTALL)
    return parse_campaign(text, CAMPAIGN.name)


def alone_ms(campaign: Campaign) -> float:
    """Mean CPU ms of the procedure called by itself, on fields of the campaign."""
    cell = expand(campaign)[0]
    method = cell.methods[0]
    params, detect = method_choice_params(campaign, method), DETECTORS[method.name].detect
    spent_s = 0.0
    for realisation in range(FIELDS_ALONE):
        observation = draw_field(campaign, cell, realisation).observation
        start = time.process_time()
        detect(observation, params, stream("bench", str(realisation)))
        spent_s += time.process_time() - start
    return 1e3 * spent_s / FIELDS_ALONE


def measured(campaign: Campaign, n_fields: int, choice: ExecutorChoice) -> Measured:
    """Run the campaign in a new folder and read its journal."""
    with tempfile.TemporaryDirectory() as folder:
        start_s, start_cpu = time.perf_counter(), _cpu_s()
        run_campaign(campaign, folder, choice)
        wall_s, cpu_s = time.perf_counter() - start_s, _cpu_s() - start_cpu
        run = open_run(folder)
        stage_ms = 1e3 * run.journal().groupby("stage")["cpu_s"].sum() / n_fields
        tasks = [line for line in run.data.journal_lines() if line["event"] == "task"]
    done_s = [datetime.fromisoformat(task["at"]).timestamp() for task in tasks]
    n_between = sum(task["stop"] - task["start"] for task in tasks[1:])
    fields_per_s = n_between / (done_s[-1] - done_s[0])
    return Measured(wall_s, 1e3 * cpu_s / n_fields, stage_ms.to_dict(), fields_per_s)


def _cpu_s() -> float:
    """CPU seconds of this process and of those it has seen end."""
    return sum(
        usage.ru_utime + usage.ru_stime
        for usage in map(resource.getrusage, (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))
    )


def tell(name: str, run: Measured) -> None:
    """One line about a run."""
    stages = ", ".join(f"{stage} {ms:.1f}" for stage, ms in run.stage_ms.items())
    rate = f"{run.wall_s:6.1f} s, {run.fields_per_s:5.1f} fields/s"
    print(f"{name:10s} {rate}, CPU {run.cpu_ms:.1f} ms a field ({stages})")


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--fields", type=int, default=1280, help="fields of each run")
    parser.add_argument("--workers", type=int, default=2, help="workers of the second run")
    parser.add_argument("--method", default="gauss_se", help="the procedure")
    given = parser.parse_args()
    campaign = campaign_of(given.method, given.fields)
    alone_ms(campaign)  # compiles
    alone = alone_ms(campaign)
    print(f"{given.method} alone: {alone:.1f} ms a field")
    serial = measured(campaign, given.fields, ExecutorChoice(serial=True))
    tell("serial", serial)
    shared = measured(campaign, given.fields, ExecutorChoice(workers=given.workers))
    tell(f"{given.workers} workers", shared)
    of_alone, of_own = (shared.fields_per_s * ms / given.workers / 1e3 for ms in (alone, shared.stage_ms["detect"]))
    share = shared.wall_s / (serial.wall_s / given.workers)
    print(
        f"throughput of {given.workers} workers over {given.workers} ÷ the procedure's own seconds: {of_alone:.3f} "
        f"with those alone, {of_own:.3f} with those in the run (bar {THROUGHPUT_BAR}, stretch {THROUGHPUT_STRETCH})\n"
        f"the same in CPU time, serial: {serial.stage_ms['detect'] / serial.cpu_ms:.3f}\n"
        f"R34 wall time over the share of the serial run: {share:.3f} (bar {SHARE_BAR})"
    )
    return int(of_own < THROUGHPUT_BAR or share > SHARE_BAR)


if __name__ == "__main__":
    sys.exit(main())
