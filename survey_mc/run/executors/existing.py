"""A dask scheduler that somebody else has started, here or on a cluster."""

from __future__ import annotations

import logging
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from survey_mc.campaign.lock import library_versions
from survey_mc.errors import BadInput, SurveyError

if TYPE_CHECKING:
    from distributed import Client

CONNECT_TIMEOUT_S = 10
PATIENCE_S = 30  # for the first worker, which is often started together with the scheduler and this process


@contextmanager
def existing_cluster(address: str | None, file: Path | None) -> Iterator[Client]:
    """A client of the scheduler at an address or of a scheduler file; `BadInput` if none answers."""
    import dask
    from dask.utils import parse_timedelta
    from distributed import Client

    # Who has told dask to wait less long means it.
    timeout_s = min(CONNECT_TIMEOUT_S, parse_timedelta(dask.config.get("distributed.comm.timeouts.connect", "30s")))
    where = address or str(file)
    # A lost scheduler is one sentence of ours, not pages of its reconnection attempts.
    for name in ("distributed", "distributed.client"):
        logging.getLogger(name).setLevel(logging.CRITICAL)
    try:
        if file is not None:
            if not file.is_file():
                raise BadInput(where, "there is no such scheduler file")
            client = Client(scheduler_file=str(file), timeout=timeout_s)
        else:
            client = Client(address, timeout=timeout_s)
    except (OSError, ValueError, KeyError) as problem:
        raise BadInput(where, f"no dask scheduler answers there ({str(problem)[:120]})") from None
    with client:
        _refuse_other_versions(client, where)
        _warn_of_strangers(client)
        yield client


def _warn_of_strangers(client: Client) -> None:
    """A dask scheduler runs what anybody sends who can reach it."""
    address = str(client.scheduler_info().get("address", ""))
    protocol, _, rest = address.partition("://")
    if protocol != "tls" and not rest.startswith(("127.", "[::1]", "localhost")):
        _warn(
            f"the scheduler at {address} listens beyond this machine without TLS: whoever reaches it can run code as "
            "you; keep it inside a trusted network or give it certificates (dask's `distributed.comm.tls`)"
        )
    threads = {name: w["nthreads"] for name, w in client.scheduler_info(n_workers=-1)["workers"].items()}
    many = [name for name, n in threads.items() if n > 1]
    if many:
        _warn(
            f"worker {many[0]} has {threads[many[0]]} threads and does one task at a time all the same; start it with "
            "`dask worker --nworkers -1 --nthreads 1` to use all cores"
        )


def _warn(sentence: str) -> None:
    print(f"survey-mc: {sentence}", file=sys.stderr)


def _refuse_other_versions(client: Client, where: str) -> None:
    """Results are promised for one set of versions: a worker that has others is refused."""
    here = library_versions()
    if not client.scheduler_info(n_workers=-1)["workers"]:
        _warn(f"{where}: the scheduler has no workers yet; waiting {PATIENCE_S} s for them")
        try:
            client.wait_for_workers(1, timeout=PATIENCE_S)
        except TimeoutError:
            raise BadInput(where, "the scheduler has no workers; start some with `dask worker`") from None
    found = client.run(library_versions)
    for worker, there in found.items():
        for name, version in here.items():
            if there.get(name) != version:
                raise SurveyError(
                    f"{where}: worker {worker} has {name} {there.get(name)}, this process has {version}; "
                    "install the same versions on both"
                )
