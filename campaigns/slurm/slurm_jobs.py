"""The jobs of worker processes that `run_on_slurm.py` queues: their script, their keys, their number, their end.

Idea     a worker ends itself before the walltime of its job, with some spread so that not all leave at once. What has
         left the queue is replaced; a job that ends before a worker of it arrived has a cause that another would have
         too.
Limits   dask's own `adapt` is not used: with several processes a job it does not notice that a job is gone
         (dask-jobqueue 0.9). Nor is `--lifetime-restart`: it would begin a life that the walltime ends. A worker that
         crashed and is restarted within its job does that too; what it was at is then done by another.
"""

from __future__ import annotations

import argparse
import getpass
import re
import shlex
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from dask_jobqueue import SLURMCluster
    from distributed import Security

RESERVE_S, RESERVE_SHARE = 180.0, 1 / 4  # of the walltime, for the start and the end of a worker
STAGGER_S, STAGGER_SHARE = 300.0, 1 / 12
DEATH_TIMEOUT_S = 60  # a worker that finds no scheduler gives its job back
SECONDS_BETWEEN_LOOKS = 15.0  # at the queue; its administrators do not like more
SECONDS_BETWEEN_OFFERS = 120.0  # of jobs that Slurm has refused
FRUITLESS_JOBS = 3
MALLOC_BYTES = 128 * 1024 * 1024
# One thread a process, memory kept for the next field, and no pauses of a worker: its results are on disk.
ENVIRONMENT = {
    "OMP_NUM_THREADS": 1,
    "OPENBLAS_NUM_THREADS": 1,
    "MKL_NUM_THREADS": 1,
    "MALLOC_ARENA_MAX": 1,
    "MALLOC_TRIM_THRESHOLD_": MALLOC_BYTES,
    "MALLOC_MMAP_THRESHOLD_": MALLOC_BYTES,
    "ARROW_DEFAULT_MEMORY_POOL": "system",
    "DASK_DISTRIBUTED__WORKER__MEMORY__TARGET": False,
    "DASK_DISTRIBUTED__WORKER__MEMORY__SPILL": False,
    "DASK_DISTRIBUTED__WORKER__MEMORY__PAUSE": False,
    "DASK_DISTRIBUTED__WORKER__PROFILE__ENABLED": False,  # 100 kB a second of what nobody looks at
    "DASK_DISTRIBUTED__ADMIN__TICK__INTERVAL": "1s",  # 50 times a second unless told otherwise: 1 % of a core
    "DASK_DISTRIBUTED__ADMIN__SYSTEM_MONITOR__INTERVAL": "2s",
}


class Refused(Exception):
    """One sentence for the person who can act."""


def say(sentence: str) -> None:
    """A line for the person."""
    print(f"run_on_slurm: {sentence}", file=sys.stderr, flush=True)


def walltime_s(text: str) -> int:
    """Seconds of a Slurm time: minutes, minutes:seconds, hours:minutes:seconds or days-hours[:minutes[:seconds]]."""
    found = re.fullmatch(r"(?:(\d+)-)?(\d+)(?::(\d+))?(?::(\d+))?", text)
    if found is None:
        raise Refused(f"--walltime: {text!r} is no Slurm time such as 90 (minutes), 01:30:00 or 1-12:00:00")
    days, *others = found.groups()
    parts = [int(part) for part in others if part is not None]
    if days is not None:
        parts = [*parts, 0, 0][:3]
    elif len(parts) < 3:
        parts = [0, *parts, 0][:3]
    hours, minutes, seconds = parts
    return ((int(days or 0) * 24 + hours) * 60 + minutes) * 60 + seconds


def lifetime_s(walltime: float, reserve: float | None) -> tuple[float, float]:
    """Mean lifetime of a worker and its largest deviation (s), so that all end before the walltime less the reserve."""
    kept = min(RESERVE_S, walltime * RESERVE_SHARE) if reserve is None else reserve
    stagger = min(STAGGER_S, walltime * STAGGER_SHARE)
    if not walltime - kept > 2 * stagger:
        raise Refused(f"a walltime of {walltime:g} s leaves no time to work beside the reserve of {kept:g} s")
    return walltime - kept - stagger, stagger


def security_of(folder: Path) -> Security:
    """TLS with the one certificate of this start, for scheduler, workers and survey-mc alike."""
    from distributed import Security

    roles = ("scheduler", "worker", "client")
    files = {f"tls_{role}_{kind}": str(folder / f"{kind}.pem") for role in roles for kind in ("cert", "key")}
    return Security(tls_ca_file=str(folder / "cert.pem"), require_encryption=True, **files)


def make_certificate(folder: Path) -> None:
    """A certificate that nobody else has; only the user can read its key."""
    command = "openssl req -x509 -newkey rsa:2048 -nodes -days 365 -subj /CN=survey_mc -keyout key.pem -out cert.pem"
    try:
        done = subprocess.run(command.split(), cwd=folder, capture_output=True, text=True, check=False)
    except FileNotFoundError:
        raise Refused("there is no openssl here to make the keys; install it or give --no-tls") from None
    if done.returncode:
        raise Refused(f"openssl made no certificate: {done.stderr.strip()[-200:]}")


def job_settings(chosen: argparse.Namespace, name: str, folder: Path) -> dict[str, Any]:
    """What dask-jobqueue has to know of a job."""
    if shlex.quote(str(folder)) != str(folder):
        raise Refused(f"{folder} stands in job scripts and must have no blanks or quotes; give another --folder")
    lifetime, stagger = lifetime_s(walltime_s(chosen.walltime), chosen.reserve)
    secured = {} if chosen.no_tls else {"security": security_of(folder), "protocol": "tls://"}
    return secured | {
        "job_name": name,
        "cores": chosen.processes,
        "processes": chosen.processes,
        "memory": f"{chosen.processes * chosen.memory_mb}MB",
        "walltime": chosen.walltime,
        "queue": chosen.partition,
        "account": chosen.account,
        "interface": chosen.interface,
        "nanny": True,
        "death_timeout": DEATH_TIMEOUT_S,
        "local_directory": f'"{chosen.local_directory}"',
        "job_extra_directives": [f"--output={folder}/%j.log", *chosen.directive],
        "job_script_prologue": [*(f"export {key}={value}" for key, value in ENVIRONMENT.items()), *chosen.prologue],
        # The page that every worker serves, even without a dashboard, would else be open to the network.
        "worker_extra_args": [
            *("--lifetime", f"{lifetime:.0f}s", "--lifetime-stagger", f"{stagger:.0f}s"),
            *("--no-dashboard", "--dashboard-address", "127.0.0.1:0"),
        ],
    }


def job_script(settings: dict[str, Any]) -> str:
    """The script of a job, but for the address of the scheduler and the name of the worker."""
    from dask_jobqueue.slurm import SLURMJob

    return str(SLURMJob("ADDRESS-OF-THE-SCHEDULER", name="NAME", **settings).job_script())


def refuse_bad_jobs(script: str) -> None:
    """Let Slurm look at the script; `Refused` with its own words if it would not take it."""
    with tempfile.NamedTemporaryFile("w", suffix=".sh") as file:
        file.write(script)
        file.flush()
        try:
            done = subprocess.run(["sbatch", "--test-only", file.name], capture_output=True, text=True, check=False)
        except FileNotFoundError:
            raise Refused("there is no sbatch here; start this on a machine of the Slurm cluster") from None
    if done.returncode:
        raise Refused(f"Slurm would not take the jobs: {done.stderr.strip()[-400:]}")


def jobs_in_queue(name: str) -> set[str] | None:
    """Numbers of the jobs of that name that wait or run; None if Slurm does not answer."""
    command = ["squeue", "--noheader", f"--user={getpass.getuser()}", f"--name={name}", "--format=%i %t"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode:
        return None
    lines = [line.split() for line in done.stdout.splitlines()]
    return {number for number, state in lines if state != "CG"}  # completing: it will not work any more


def cancel(name: str) -> None:
    """Cancel all jobs of that name, waiting or running."""
    subprocess.run(["scancel", f"--user={getpass.getuser()}", f"--name={name}"], capture_output=True, check=False)


class Keeper:
    """Queues jobs of a cluster and keeps their number. name: of the jobs. folder: with their logs."""

    def __init__(self, cluster: SLURMCluster, name: str, jobs: int, folder: Path) -> None:
        self.cluster, self.name, self.jobs, self.folder = cluster, name, jobs, folder
        self.fruitful: set[str] = set()
        self.fruitless = 0
        self._looked_s = self._offer_s = float("-inf")

    def look(self) -> None:
        """Replace what is gone, a few times a minute; `Refused` if jobs only come to nothing."""
        now = time.monotonic()
        if now - self._looked_s < SECONDS_BETWEEN_LOOKS:
            return
        self._looked_s = now
        # Known before the queue is read, so that a job queued meanwhile is not taken for one that has left.
        known = {key: job for key, job in dict(self.cluster.workers).items() if key in self.cluster.worker_spec}
        # Worker 2 of job A-7 is A-7-2; a job of one process gives it its own name.
        present = {str(worker) for worker in self.cluster.observed}
        self.fruitful |= known.keys() & (present | {worker.rpartition("-")[0] for worker in present})
        queued = jobs_in_queue(self.name)
        if queued is None:
            return
        for key, job in known.items():
            if job.job_id is None:
                self._offer_s = now + SECONDS_BETWEEN_OFFERS
            elif job.job_id not in queued:
                self._take_leave(key, job.job_id)
            else:
                continue
            self.cluster.worker_spec.pop(key, None)
        if now >= self._offer_s:
            self.cluster.scale(jobs=self.jobs)
        elif self._offer_s == now + SECONDS_BETWEEN_OFFERS:
            say("Slurm has refused a job; it is offered again in two minutes")

    def _take_leave(self, key: str, number: str) -> None:
        self.fruitless = 0 if key in self.fruitful else self.fruitless + 1
        if self.fruitless >= FRUITLESS_JOBS:
            raise Refused(
                f"{self.fruitless} jobs in a row ended before a worker of theirs arrived; their logs are in "
                f"{self.folder}"
            )
        say(f"job {number} has left the queue; another takes its place")
