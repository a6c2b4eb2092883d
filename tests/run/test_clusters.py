"""Work on a dask scheduler and workers that were started by hand, and what listens where during a run."""

from __future__ import annotations

import os
import signal
import socket
import subprocess
import sys
import time
from pathlib import Path

import pytest
from faults.fault_tools import (
    cluster,
    descendants,
    environment,
    finish,
    hashes,
    manifest_lines,
    reference,
    start,
    write_campaign,
)
from small_campaigns import small

from survey_mc.campaign import expand
from survey_mc.errors import SurveyError
from survey_mc.run.order import Order
from survey_mc.run.task import run_task

LISTENING = "0A"


@pytest.fixture(scope="module")
def campaign(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_campaign(tmp_path_factory.mktemp("campaign"), 36, extra="")


@pytest.fixture(scope="module")
def serial(campaign: Path) -> dict[str, str]:
    return reference(campaign, campaign.parent / "reference", "--serial", "--no-report")


def listeners(pids: list[int]) -> set[str]:
    """Addresses on which these processes listen."""
    inodes = set()
    for pid in pids:
        for link in Path(f"/proc/{pid}/fd").glob("*"):
            try:
                target = os.readlink(link)
            except OSError:
                continue
            if target.startswith("socket:["):
                inodes.add(target[8:-1])
    found = set()
    for name in ("tcp", "tcp6"):
        for line in Path(f"/proc/net/{name}").read_text().splitlines()[1:]:
            _, local, _, state, *others = line.split()
            if state == LISTENING and others[5] in inodes:
                packed = bytes.fromhex(local.partition(":")[0])
                words = b"".join(packed[i : i + 4][::-1] for i in range(0, len(packed), 4))
                found.add(socket.inet_ntop(socket.AF_INET if name == "tcp" else socket.AF_INET6, words))
    return found


def test_the_listeners_of_a_process_are_found() -> None:
    with socket.create_server(("127.0.0.1", 0)), socket.create_server(("0.0.0.0", 0)):
        assert {"127.0.0.1", "0.0.0.0"} <= listeners([os.getpid()])


def test_nothing_listens_beyond_loopback(campaign: Path, serial: dict[str, str], tmp_path: Path) -> None:
    driver = start(campaign, tmp_path / "run", "--workers", "2", "--block", "1", "--no-report")
    found: set[str] = set()
    while driver.poll() is None:
        found |= listeners([driver.pid, *descendants(driver.pid)])
        time.sleep(0.1)

    assert finish(driver)[0] == 0
    assert found == {"127.0.0.1"}
    assert hashes(tmp_path / "run", tables=False) == serial


def test_a_scheduler_started_by_hand_gives_the_same_bytes_and_its_death_one_sentence(
    campaign: Path, serial: dict[str, str], tmp_path: Path
) -> None:
    root = tmp_path / "run"
    with cluster(tmp_path) as (file, started):
        driver = start(campaign, root, "--scheduler-file", file, "--block", "1", "--no-report")
        while manifest_lines(root) < 12 and driver.poll() is None:
            time.sleep(0.02)
        started["scheduler"].send_signal(signal.SIGKILL)
        code, said = finish(driver, 120.0)
    assert code == 2, said
    last = [line for line in said.splitlines() if line.startswith("survey-mc: ") and "no workers yet" not in line]
    assert last == [
        "survey-mc: the connection to the dask scheduler was lost; what is finished is stored, and the same command "
        "goes on from there"
    ]
    assert "Traceback" not in said

    with cluster(tmp_path) as (file, _):
        code, said = finish(start(campaign, root, "--scheduler-file", file, "--no-report"))
    assert code == 0, said
    assert hashes(root, tables=False) == serial


def test_workers_with_other_versions_are_refused_with_both_named(campaign: Path, tmp_path: Path) -> None:
    other = tmp_path / "other" / "sep-99.0.dist-info"
    other.mkdir(parents=True)
    (other / "METADATA").write_text("Metadata-Version: 2.1\nName: sep\nVersion: 99.0\n")
    env = environment()
    env["PYTHONPATH"] = f"{other.parent}{os.pathsep}{env['PYTHONPATH']}"
    with cluster(tmp_path, 1, env=env) as (file, _):
        code, said = finish(start(campaign, tmp_path / "run", "--scheduler-file", file, "--no-report"))

    assert code == 2
    assert "has sep 99.0, this process has" in said
    assert not list((tmp_path / "run").rglob("*.parquet"))


def test_a_worker_that_joins_later_is_asked_too(tmp_path: Path) -> None:
    campaign = small()
    label = expand(campaign)[0].methods[0].label
    order = Order(campaign, tmp_path, 0, 0, 1, True, (label,), (label,), versions={"numpy": "0.1"})

    with pytest.raises(SurveyError, match=r"has numpy \d.*, the run was started with 0\.1; install the same"):
        run_task(order)


def test_no_scheduler_there_is_one_sentence(campaign: Path, tmp_path: Path) -> None:
    with socket.create_server(("127.0.0.1", 0)) as server:
        port = server.getsockname()[1]
    soon = environment(DASK_DISTRIBUTED__COMM__TIMEOUTS__CONNECT="1s")
    options = ("--scheduler", f"tcp://127.0.0.1:{port}", "--no-report")
    code, said = finish(start(campaign, tmp_path / "run", *options, env=soon))

    assert code == 2
    assert said.startswith(f"survey-mc: tcp://127.0.0.1:{port}: no dask scheduler answers there")
    assert len(said.splitlines()) == 1


INTERRUPTED_AT_THE_END = """
import os, signal, threading
from survey_mc.run.executors.local import local_cluster

said = []
signal.signal(signal.SIGTERM, signal.default_int_handler)
try:
    with local_cluster(1, None) as local:
        cluster, close = local.cluster, local.cluster.close

        def interrupted_close(*arguments, **options):
            cluster.close = close
            threading.Timer(0.05, os.kill, (os.getpid(), signal.{name})).start()
            return close(*arguments, **options)

        cluster.close = interrupted_close
except KeyboardInterrupt:
    said.append("interrupted")
print(*said, cluster.status.name)
"""


@pytest.mark.parametrize("name", ["SIGINT", "SIGTERM"])
def test_a_signal_that_comes_while_a_cluster_ends_waits_until_it_has_ended(name: str) -> None:
    """Otherwise dask waits ten seconds for it when the interpreter ends."""
    script = INTERRUPTED_AT_THE_END.replace("{name}", name)
    done = subprocess.run(
        [sys.executable, "-c", script], env=environment(), capture_output=True, text=True, timeout=120
    )
    assert (done.returncode, done.stdout.split()) == (0, ["interrupted", "closed"]), done.stderr
