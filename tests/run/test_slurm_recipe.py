"""The recipe for Slurm: what stands in its job scripts, and what it does when jobs come and go. Needs no Slurm."""

from __future__ import annotations

import importlib.util
import os
import re
import subprocess
import sys
import tomllib
from pathlib import Path
from types import SimpleNamespace

import pytest

REPOSITORY = Path(__file__).parents[2]
FOLDER = REPOSITORY / "campaigns" / "slurm"
SCRIPT, SBATCH = FOLDER / "run_on_slurm.py", FOLDER / "survey_mc.sbatch"


@pytest.fixture(scope="module")
def jobs():
    """The module beside the script, which is no part of the package."""
    spec = importlib.util.spec_from_file_location("slurm_jobs", FOLDER / "slurm_jobs.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def start(folder, *options, **variables):
    """The script in a process of its own, with `folder` for commands of Slurm and nothing else on the path."""
    return subprocess.run(
        [sys.executable, str(SCRIPT), "c.toml", "--out", str(folder / "run"), "--interface", "lo", *options],
        capture_output=True,
        text=True,
        timeout=60,
        env=os.environ | {"PATH": str(folder)} | variables,
        check=False,
    )


def fake(folder, name, text):
    """A command of Slurm that does as it is told."""
    (folder / name).write_text(f"#!/bin/sh\n{text}\n")
    (folder / name).chmod(0o755)


@pytest.mark.parametrize(
    ("text", "seconds"),
    [("90", 5400), ("2:30", 150), ("01:30:00", 5400), ("1-12", 129600), ("1-12:30", 131400), ("1-00:00:01", 86401)],
)
def test_a_walltime_is_read_as_slurm_does(jobs, text, seconds):
    assert jobs.walltime_s(text) == seconds


@pytest.mark.parametrize("text", ["", "1h", "1:2:3:4", "-5", "1-", "unlimited"])
def test_what_is_no_walltime_is_refused(jobs, text):
    with pytest.raises(jobs.Refused, match="no Slurm time"):
        jobs.walltime_s(text)


@pytest.mark.parametrize("walltime", [60, 600, 3600, 86400, 604800])
def test_every_worker_ends_before_the_walltime_less_the_reserve(jobs, walltime):
    lifetime, stagger = jobs.lifetime_s(walltime, None)
    assert lifetime + stagger <= walltime - min(180, walltime / 4)
    assert lifetime - stagger >= walltime / 2


def test_a_reserve_that_leaves_no_time_is_refused(jobs):
    with pytest.raises(jobs.Refused, match="no time to work"):
        jobs.lifetime_s(600, 600)


def test_the_job_script_is_safe_for_walltime_memory_and_network(tmp_path):
    pytest.importorskip("dask_jobqueue")
    done = start(
        tmp_path,
        *("--dry-run", "--jobs", "3", "--processes", "4", "--memory-mb", "1500", "--walltime", "00:30:00"),
        *("--partition", "short", "--directive=--constraint=avx2", "--prologue", "module load python"),
    )
    assert done.returncode == 0, done.stderr
    script = done.stdout
    for line in ("#SBATCH --cpus-per-task=4", "#SBATCH --mem=6G", "#SBATCH -t 00:30:00", "#SBATCH -p short",
                 "#SBATCH --constraint=avx2", "module load python", "export OMP_NUM_THREADS=1"):  # fmt: skip
        assert line in script.splitlines(), line
    worker = script.strip().splitlines()[-1]
    for words in ("--nthreads 1", "--nworkers 4", "--nanny", "--lifetime 1470s", "--lifetime-stagger 150s",
                  "--interface lo", "--protocol tls://", "--dashboard-address 127.0.0.1:0"):  # fmt: skip
        assert f" {words} " in worker, words
    assert "--lifetime-restart" not in worker
    assert re.search(r"--memory-limit 1\.[34]\d*GiB", worker)
    assert list(tmp_path.iterdir()) == []  # a dry run writes nothing


def test_what_slurm_would_refuse_is_one_sentence_before_anything_is_queued(tmp_path):
    pytest.importorskip("dask_jobqueue")
    absent = start(tmp_path)
    assert (absent.returncode, "there is no sbatch here" in absent.stderr) == (2, True)
    fake(tmp_path, "sbatch", "echo 'sbatch: error: invalid partition specified: short' >&2; exit 1")
    refused = start(tmp_path, "--partition", "short")
    assert refused.returncode == 2
    assert "invalid partition specified: short" in refused.stderr
    assert "Traceback" not in absent.stderr + refused.stderr
    assert [path.name for path in tmp_path.iterdir()] == ["sbatch"]


def test_folders_that_would_break_a_job_script_are_refused(tmp_path):
    done = start(tmp_path, "--dry-run", "--folder", str(tmp_path / "a b"))
    assert done.returncode == 2
    assert "no blanks" in done.stderr


class Cluster:
    """A cluster of dask-jobqueue whose jobs are numbers."""

    def __init__(self, processes=2):
        self.processes, self.made = processes, 0
        self.worker_spec, self.workers, self.observed = {}, {}, set()

    def scale(self, jobs):
        while len(self.worker_spec) < jobs:
            key = f"S-{self.made}"
            self.worker_spec[key] = {}
            self.workers[key] = SimpleNamespace(job_id=str(100 + self.made))
            self.made += 1

    def arrive(self, key):
        self.observed |= {f"{key}-{number}" for number in range(self.processes)} if self.processes > 1 else {key}


@pytest.fixture
def kept(jobs, monkeypatch, tmp_path):
    """A keeper of three jobs, and what it finds in the queue."""
    queue = set()
    monkeypatch.setattr(jobs, "jobs_in_queue", lambda name: set(queue))
    monkeypatch.setattr(jobs, "SECONDS_BETWEEN_LOOKS", 0.0)
    return jobs.Keeper(Cluster(), "name", 3, tmp_path), queue


def test_a_job_that_has_left_the_queue_is_replaced(kept):
    keeper, queue = kept
    keeper.look()
    queue |= {"100", "101", "102", "103"}
    keeper.cluster.arrive("S-1")
    keeper.look()
    assert keeper.cluster.made == 3
    queue.remove("101")
    keeper.look()
    keeper.look()  # the old one may be known a while longer
    assert sorted(keeper.cluster.worker_spec) == ["S-0", "S-2", "S-3"]
    assert keeper.fruitless == 0


def test_jobs_that_end_without_a_worker_end_the_run(kept, jobs):
    keeper, _ = kept
    keeper.look()
    with pytest.raises(jobs.Refused, match="3 jobs in a row ended before a worker"):
        keeper.look()


def test_nothing_is_replaced_while_slurm_does_not_answer(kept, jobs, monkeypatch):
    keeper, _ = kept
    keeper.look()
    monkeypatch.setattr(jobs, "jobs_in_queue", lambda name: None)
    keeper.look()
    assert keeper.cluster.made == 3


def test_a_refused_job_is_offered_again_later(kept, jobs, monkeypatch, capsys):
    keeper, queue = kept
    keeper.look()
    queue |= {"100", "101"}
    keeper.cluster.workers["S-2"].job_id = None
    keeper.look()
    keeper.look()
    assert keeper.cluster.made == 3
    assert capsys.readouterr().err.count("refused") == 1
    now = jobs.time.monotonic()
    monkeypatch.setattr(jobs.time, "monotonic", lambda: now + 1000.0)
    keeper.look()
    assert keeper.cluster.made == 4


def test_a_job_that_is_ending_is_not_in_the_queue_any_more(jobs, tmp_path, monkeypatch):
    monkeypatch.setenv("PATH", str(tmp_path), prepend=os.pathsep)
    fake(tmp_path, "squeue", "printf '7 R\\n8 CG\\n9 PD\\n'")
    assert jobs.jobs_in_queue("name") == {"7", "9"}
    fake(tmp_path, "squeue", "exit 1")
    assert jobs.jobs_in_queue("name") is None


def test_the_one_job_script_is_bash_and_says_what_it_lacks(tmp_path):
    assert subprocess.run(["bash", "-n", str(SBATCH)], capture_output=True, check=False).returncode == 0
    for arguments, lack in (([], "CAMPAIGN.toml DIR"), (["c.toml", str(tmp_path / "run")], "give it to sbatch")):
        clean = {key: value for key, value in os.environ.items() if not key.startswith("SLURM_")}
        done = subprocess.run(
            ["bash", str(SBATCH), *arguments], capture_output=True, text=True, env=clean, timeout=60, check=False
        )
        assert (done.returncode, lack in done.stderr) == (2, True), done.stderr
    assert list(tmp_path.iterdir()) == []


def test_both_recipes_give_the_workers_the_same_environment(jobs):
    text = SBATCH.read_text()
    for key, value in jobs.ENVIRONMENT.items():
        assert f"{key}={value}" in text, key


def test_the_extra_brings_what_the_recipe_imports():
    extras = tomllib.loads((REPOSITORY / "pyproject.toml").read_text())["project"]["optional-dependencies"]
    assert any(need.startswith("dask-jobqueue") for need in extras["slurm"])
    assert any(need.startswith("bokeh") for need in extras["dashboard"])
