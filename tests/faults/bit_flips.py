"""R11: single bits are flipped all over a finished run; `verify` has to report each, and no reader may use one
silently.

A small run with inputs, report and journal is made (seconds); then, for each flip, a kind of file (stored file,
manifest, lock, campaign, input, journal, tables, their list, report), a file, a byte and a bit are drawn, the bit is
flipped, the run is verified, its rows, lock and journal are read, and the bit is flipped back. 1000 flips take about
two minutes.
"""

from __future__ import annotations

import argparse
import random
import sys
import tempfile
from collections import Counter
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1]))
sys.path.insert(0, str(Path(__file__).parents[2]))

from damaged_runs import contents, kind_of_file, make_run

from survey_mc.errors import SurveyError
from survey_mc.run import open_run, verify_run


def flip(path: Path, byte: int, bit: int) -> None:
    with path.open("r+b") as handle:
        handle.seek(byte)
        (value,) = handle.read(1)
        handle.seek(byte)
        handle.write(bytes([value ^ 1 << bit]))


def what_is_read(root: Path) -> list[object]:
    """Everything a reader gets of a run: lock, all rows, journal."""
    run = open_run(root)
    frames = [run.truth(), run.detections(), run.matches(), run.links()]
    return [run.data.lock, *(frame.to_csv() for frame in frames), list(run.data.journal_lines())]


def is_silent(root: Path, before: list[object]) -> bool:
    """Whether a reader gets something else than before without an error. Journals may lack lines, not change them."""
    try:
        lock, *frames, journal = what_is_read(root)
    except SurveyError:
        return False
    return [lock, *frames] != before[:-1] or any(line not in before[-1] for line in journal)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--n", type=int, default=1000, help="flips (default 1000)")
    parser.add_argument("--seed", type=int, default=11)
    asked = parser.parse_args()
    chooser = random.Random(asked.seed)
    with tempfile.TemporaryDirectory() as folder:
        root = make_run(Path(folder))
        by_kind: dict[str, list[str]] = {}
        for path in sorted(contents(root)):
            by_kind.setdefault(kind_of_file(path), []).append(path)
        before = what_is_read(root)
        flipped: Counter[str] = Counter()
        missed, silent = [], []
        for _ in range(asked.n):
            kind = chooser.choice(sorted(by_kind))
            path = chooser.choice(by_kind[kind])
            byte, bit = chooser.randrange((root / path).stat().st_size), chooser.randrange(8)
            flip(root / path, byte, bit)
            flipped[kind] += 1
            if verify_run(root).n_damaged == 0:
                missed.append(f"{path} byte {byte} bit {bit}")
            if is_silent(root, before):
                silent.append(f"{path} byte {byte} bit {bit}")
            flip(root / path, byte, bit)
        assert verify_run(root).sound
    for place in missed[:10]:
        print(f"not reported: {place}")
    for place in silent[:10]:
        print(f"used silently: {place}")
    print("  " + ", ".join(f"{number} {kind}" for kind, number in sorted(flipped.items())))
    print(f"R11 single-bit flips reported by verify: {asked.n - len(missed)} of {asked.n}, bar all")
    print(f"R11 flips that a reader used without an error: {len(silent)} of {asked.n}, bar 0")
    return 1 if missed or silent else 0


if __name__ == "__main__":
    sys.exit(main())
