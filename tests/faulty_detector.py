"""A detector that goes wrong on chosen fields, as an installed package that worker processes find by themselves.

The file named by FAULTS holds {"<photons of the field>": "<kind of fault>"}; on all other fields it finds nothing.
"""

from __future__ import annotations

import json
import os
from pathlib import Path

from survey_mc.campaign import Campaign, draw_field, expand
from survey_mc.store.layout import RunLayout

METADATA = "Metadata-Version: 2.1\nName: faulty-detector\nVersion: 0.1\n"

MODULE = """
import ctypes, json, os, signal, sys, time
import numpy as np
from survey_mc.detect import Detector, DetectorParams, detections_frame

class FaultyParams(DetectorParams):
    pass

def endless_python():
    while True:
        pass

def endless_compiled():
    ctypes.PyDLL(None).sleep(100_000)  # holds the lock of the interpreter

def swallow():
    try:
        endless_python()
    except Exception:
        return

FAULTS = {
    "segfault": lambda: ctypes.string_at(0),
    "exit": lambda: os._exit(7),
    "kill": lambda: os.kill(os.getpid(), signal.SIGKILL),
    "abort": os.abort,
    "loop": swallow,
    "lock": endless_compiled,
    "memory": lambda: np.ones(10 * 2**30 // 8),
    "exception": lambda: 1 / 0,
    "sys.exit": lambda: sys.exit(0),
    "interrupt": lambda: (_ for _ in ()).throw(GeneratorExit("odd")),
    "slow": lambda: time.sleep(0.2),
}

def detect(obs, params, rng):
    with open(os.environ["FAULTS"]) as handle:
        kind = json.load(handle).get(str(int(obs.counts.sum())))
    if kind:
        FAULTS[kind]()
    names = ("x_pix", "y_pix", "x_err_pix", "y_err_pix", "counts", "counts_err", "background_per_pix", "significance",
             "r50_arcsec", "flags")
    return detections_frame(obs, {name: np.zeros(0) for name in names}, extra_columns=())

PAPER = FaultyParams()
DETECTOR = Detector("faulty", "Faulty", 1, "goes wrong", "nobody", FaultyParams, detect, tiny=PAPER,
                    profiles={"paper": PAPER}, view=lambda obs, params: obs.counts)
"""

METHOD = """
[[method]]
name = "faulty"
label = "F"
"""


def install_faulty(folder: Path) -> None:
    """Put the package into a folder that is to be on the path of Python."""
    (folder / "faulty.py").write_text(MODULE)
    info = folder / "faulty_detector-0.1.dist-info"
    info.mkdir()
    (info / "METADATA").write_text(METADATA)
    (info / "entry_points.txt").write_text("[survey_mc.detectors]\nfaulty = faulty:DETECTOR\n")


def environment(folder: Path) -> dict[str, str]:
    """Variables of a process that finds the package and its faults."""
    here = Path(__file__).parents[1]
    paths = [str(folder), str(here), os.environ.get("PYTHONPATH", "")]
    return os.environ | {"PYTHONPATH": os.pathsep.join(p for p in paths if p), "FAULTS": str(folder / "faults.json")}


def plant(folder: Path, campaign: Campaign, faults: dict[int, str]) -> None:
    """Let the detector go wrong on these realisations of the first cell of a campaign."""
    cell = expand(campaign)[0]
    photons = {j: int(draw_field(campaign, cell, j).observation.counts.sum()) for j in range(cell.realisations)}
    assert all(list(photons.values()).count(photons[j]) == 1 for j in faults), "another field has as many photons"
    (folder / "faults.json").write_text(json.dumps({str(photons[j]): kind for j, kind in faults.items()}))


def journal_events(root: Path, event: str) -> list[dict[str, object]]:
    """All entries of a kind in the journals of a run."""
    lines = [
        line for path in sorted(RunLayout(root).journals.glob("*.jsonl")) for line in path.read_text().splitlines()
    ]
    return [entry for entry in map(json.loads, lines) if entry["event"] == event]
