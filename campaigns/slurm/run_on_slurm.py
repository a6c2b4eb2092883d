"""Run a campaign on a Slurm cluster: queue jobs of worker processes, keep their number, and start `survey-mc run`.

Idea     this process holds the dask scheduler and queues the jobs (dask-jobqueue). A job that ends is replaced, so that
         a run may take longer than any job. Stopped at any moment (Ctrl-C, SIGTERM, the end of its own job), it cancels
         its jobs; the same command goes on from there.
Limits   the run directory must be on a file system that all nodes share. What a worker is busy with when its time is
         over is begun again by another: some seconds for each worker and walltime.
"""

from __future__ import annotations

import argparse
import logging
import os
import signal
import subprocess
import sys
import time
import uuid
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from types import FrameType
from typing import TYPE_CHECKING, Any, NoReturn

from slurm_jobs import Keeper, Refused, cancel, job_script, job_settings, make_certificate, refuse_bad_jobs, say

if TYPE_CHECKING:
    from dask_jobqueue import SLURMCluster

SURVEY_MC = [sys.executable, "-c", "from survey_mc.cli import main; main()"]
WORKER_SHARE = 0.9  # of a process's memory is survey-mc's to allot; dask kills at 0.95
LEAST_MEMORY_MB = 700
SECONDS_TO_STOP = 15.0  # for survey-mc; Slurm kills 30 s after it has asked
STOPPING = (signal.SIGINT, signal.SIGTERM)
TLS = "DASK_DISTRIBUTED__COMM__TLS__"
KEYS = {f"{TLS}CA_FILE": "cert.pem", f"{TLS}CLIENT__CERT": "cert.pem", f"{TLS}CLIENT__KEY": "key.pem"}

SCHEDULING = {
    "distributed.scheduler.allowed-failures": 10,  # an order outlives the deaths of workers
    "distributed.scheduler.worker-saturation": 1.0,  # a worker is given what it can do now and no more
    "distributed.deploy.lost-worker-timeout": "1 hour",  # its job is not cancelled while it is restarted
}


class Stopped(BaseException):
    """A signal asked for the end. args: its number."""


def parse(arguments: list[str]) -> argparse.Namespace:
    """The options of this script, and in `others` those behind `--`, which are for `survey-mc run`."""
    cut = arguments.index("--") if "--" in arguments else len(arguments)
    parser = argparse.ArgumentParser(
        description=__doc__,
        epilog="Options behind -- are given to survey-mc run: … -- --retry-failed --field-timeout 300",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    add = parser.add_argument
    add("campaign", type=Path, metavar="CAMPAIGN.toml")
    add("--out", type=Path, required=True, metavar="DIR", help="run directory, on a file system that the nodes share")
    add("--interface", required=True, metavar="NAME", help="network interface of scheduler and workers: ib0, eth0, …")
    add("--scheduler-interface", metavar="NAME", help="that of the scheduler, where it has another name here")
    add("--jobs", type=int, default=2, metavar="N", help="jobs to keep in the queue (default %(default)s)")
    add("--processes", type=int, default=8, metavar="P", help="worker processes = cores of a job (default %(default)s)")
    add("--memory-mb", type=int, default=2000, metavar="MB", help="memory of each process (default %(default)s)")
    add("--walltime", default="01:00:00", metavar="TIME", help="of a job, as Slurm writes it (default %(default)s)")
    add("--reserve", type=float, metavar="S", help="workers end so long before it (default: 180, at most a quarter)")
    add("--partition", metavar="NAME", help="Slurm's -p")
    add("--account", metavar="NAME", help="Slurm's -A")
    add("--directive", action="append", default=[], metavar="'--x=y'", help="a further #SBATCH line; may be repeated")
    add("--prologue", action="append", default=[], metavar="COMMAND", help="shell line before the workers start")
    add("--local-directory", default="${TMPDIR:-/tmp}", metavar="DIR", help="scratch of a node (default %(default)s)")
    add("--folder", type=Path, metavar="DIR", help="shared folder of logs and keys (default: run directory + .slurm)")
    add("--dashboard", type=int, metavar="PORT", help="serve dask's dashboard on loopback (needs bokeh)")
    add("--no-tls", action="store_true", help="no encryption: whoever reaches the scheduler can run code as you")
    add("--dry-run", action="store_true", help="print the script of a job and queue nothing")
    chosen = parser.parse_args(arguments[:cut])
    chosen.others = arguments[cut + 1 :]
    if chosen.jobs < 1 or chosen.processes < 1 or chosen.memory_mb < LEAST_MEMORY_MB:
        parser.error(f"--jobs and --processes must be at least 1, --memory-mb at least {LEAST_MEMORY_MB}")
    return chosen


@contextmanager
def cluster_of(chosen: argparse.Namespace, name: str, folder: Path, settings: dict[str, Any]) -> Iterator[SLURMCluster]:
    """A cluster without jobs; at the end of the block no job of it is left, and no key."""
    import dask
    from dask_jobqueue import SLURMCluster

    # A refused job is told by the keeper.
    logging.getLogger("tornado.application").setLevel(logging.CRITICAL)
    scheduler = {
        "interface": chosen.scheduler_interface or chosen.interface,
        "dashboard": chosen.dashboard is not None,
        "dashboard_address": f"127.0.0.1:{chosen.dashboard or 0}",
        "scheduler_file": str(folder / "scheduler.json"),
    }
    dask.config.set(SCHEDULING)
    try:
        cluster = SLURMCluster(scheduler_options=scheduler, silence_logs="critical", **settings)
        try:
            yield cluster
        finally:
            before = {number: signal.signal(number, signal.SIG_IGN) for number in STOPPING}
            cancel(name)
            cluster.close()
            cancel(name)  # what was being queued in that moment
            for number, handler in before.items():
                signal.signal(number, handler)
    finally:
        for left in ("scheduler.json", "key.pem", "cert.pem"):
            (folder / left).unlink(missing_ok=True)


def survey(chosen: argparse.Namespace, folder: Path, keeper: Keeper) -> int:
    """Exit code of `survey-mc run` on the cluster, once a worker has come."""
    said_s = float("-inf")
    while not keeper.cluster.observed:
        keeper.look()
        if time.monotonic() - said_s > 60.0:
            said_s = time.monotonic()
            say("waiting in the queue for a first worker")
        time.sleep(1.0)
    environment = os.environ | ({} if chosen.no_tls else {key: str(folder / file) for key, file in KEYS.items()})
    # A limit of ours before dask's: then a procedure fails on one field, and no worker dies.
    options = ["--memory-limit", str(int(chosen.memory_mb * WORKER_SHARE)), "--no-report", *chosen.others]
    command = [*SURVEY_MC, "run", str(chosen.campaign), "--out", str(chosen.out)]
    command += ["--scheduler-file", str(folder / "scheduler.json"), *options]
    # In a session of its own: Ctrl-C is for this process, which hands it on.
    with subprocess.Popen(command, env=environment, start_new_session=True) as process:
        try:
            while process.poll() is None:
                keeper.look()
                time.sleep(1.0)
        finally:
            if process.poll() is None:
                process.terminate()
                cancel(keeper.name)
                try:
                    process.wait(SECONDS_TO_STOP)
                except subprocess.TimeoutExpired:
                    process.kill()
    return process.returncode if process.returncode >= 0 else 128 - process.returncode


def run(chosen: argparse.Namespace) -> int:
    """Queue the jobs, run the campaign, cancel the jobs, make the report."""
    name = f"survey_mc-{uuid.uuid4().hex[:8]}"
    folder = (chosen.folder or chosen.out.with_name(f"{chosen.out.name}.slurm")).absolute() / name
    settings = job_settings(chosen, name, folder)
    if chosen.dry_run:
        print(job_script(settings))
        return 0
    refuse_bad_jobs(job_script(settings))
    checked = subprocess.run([*SURVEY_MC, "validate", str(chosen.campaign)], stdout=subprocess.DEVNULL, check=False)
    if checked.returncode:
        return checked.returncode
    folder.mkdir(parents=True, mode=0o700)
    if not chosen.no_tls:
        make_certificate(folder)
    with cluster_of(chosen, name, folder, settings) as cluster:
        if chosen.dashboard is not None:
            say(f"dask dashboard: {cluster.dashboard_link}")
        code = survey(chosen, folder, Keeper(cluster, name, chosen.jobs, folder))
    # Without the jobs: idle cores are charged too.
    if code in (0, 3) and "--no-report" not in chosen.others:
        subprocess.run([*SURVEY_MC, "report", str(chosen.out)], check=False)
    return code


def main(arguments: list[str] | None = None) -> int:
    """Exit codes are those of `survey-mc run`."""

    def stop(number: int, frame: FrameType | None) -> NoReturn:
        raise Stopped(number)

    for number in STOPPING:
        signal.signal(number, stop)
    try:
        return run(parse(sys.argv[1:] if arguments is None else arguments))
    except Refused as problem:
        say(str(problem))
        return 2
    except ImportError as problem:
        say(f"{problem}; pip install 'survey-mc[slurm]'")
        return 2
    except Stopped as stopped:
        say("stopped, and the jobs are cancelled; the same command goes on from there")
        return 128 + int(stopped.args[0])


if __name__ == "__main__":
    sys.exit(main())
