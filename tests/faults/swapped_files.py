"""R13: files of a finished run are deleted, added, swapped with one another or renamed; `verify` has to find each.

Four times --n cases on stored files, and as many on the other files of the run directory (inputs, tables, report, lock,
manifest); after each, `verify --repair` has to leave every byte as it was, but for inputs, which it cannot compute and
names. What the run did not make must not be deleted: it is moved to `strays/`. 20 cases of each take five minutes.
"""

from __future__ import annotations

import argparse
import random
import shutil
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1]))
sys.path.insert(0, str(Path(__file__).parents[2]))

from damaged_runs import call, contents, kind_of_file, make_run, restore

COSTS = (
    "report/cost.png",
    "report/index.html",
    "runs/cpu_seconds.csv",
    "runs/cpu_seconds.parquet",
    "tables.sha256",
)
Fault = Callable[[Path, list[str], random.Random], list[str]]


def delete(root: Path, paths: list[str], chooser: random.Random) -> list[str]:
    path = chooser.choice(paths)
    (root / path).unlink()
    return [path]


def add(root: Path, paths: list[str], chooser: random.Random) -> list[str]:
    """A copy of a file under another name, or somebody's notes, beside it."""
    path = Path(chooser.choice(paths))
    names = (f"copy of {path.name}", "notes.txt", f"{path.stem}.bak", f"9{path.name[1:]}")
    extra = path.with_name(chooser.choice(names))
    shutil.copyfile(root / path, root / extra)
    return [extra.as_posix()]


def swap(root: Path, paths: list[str], chooser: random.Random) -> list[str]:
    """Two files with different content."""
    while True:
        first, second = chooser.sample(paths, 2)
        one, other = (root / first).read_bytes(), (root / second).read_bytes()
        if one != other:
            (root / first).write_bytes(other)
            (root / second).write_bytes(one)
            return [first, second]


def rename(root: Path, paths: list[str], chooser: random.Random) -> list[str]:
    path = Path(chooser.choice(paths))
    new = path.with_name(chooser.choice((f"old-{path.name}", f"{path.name}.1", f"9{path.name[1:]}")))
    (root / path).rename(root / new)
    return [path.as_posix()]


FAULTS: dict[str, Fault] = {"deleted": delete, "extra": add, "swapped": swap, "renamed": rename}


def judge(root: Path, whole: dict[str, bytes], touched: list[str], fault: str) -> str:
    """Empty, or what went wrong."""
    code, said = call("verify", root)
    if not all(path in said for path in touched) or (code != 4 and "left over" not in said):
        return f"not found: exit {code}: {said[:300]}"
    code, said = call("verify", root, "--repair", "--serial")
    if fault != "extra" and any(kind_of_file(path) == "input" for path in touched):
        return "" if code == 4 and "put it back" in said else f"exit {code}: {said[:300]}"
    after = contents(root)
    # Fields that are computed again cost CPU seconds, which a report that is made again tells.
    spent = COSTS if after["runs/cpu_seconds.csv"] != whole["runs/cpu_seconds.csv"] else ()
    kept = [path for path in whole if kind_of_file(path) != "journal" and path not in spent]
    same = all(after.get(path) == whole[path] for path in kept)
    strange = [path for path in after if path not in whole and kind_of_file(path) not in ("journal", "table")]
    strange = [path for path in strange if not path.startswith("strays/")]
    if code != 0 or not same or strange:
        return f"not repaired: exit {code}: {said[:300]} {strange}"
    code, said = call("verify", root)
    return "" if code == 0 and "left over" not in said else f"not sound after the repair: {said[:300]}"


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--n", type=int, default=20, help="cases of each of the eight kinds (default 20)")
    parser.add_argument("--seed", type=int, default=13)
    asked = parser.parse_args()
    chooser = random.Random(asked.seed)
    wrong, n_all = [], 0
    with tempfile.TemporaryDirectory() as folder:
        root = make_run(Path(folder))
        whole = contents(root)
        stored = sorted(path for path in whole if kind_of_file(path) == "stored file")
        others = sorted(path for path in whole if kind_of_file(path) not in ("stored file", "journal"))
        for name, fault in FAULTS.items():
            n_good = 0
            for number in range(2 * asked.n):
                # Beside files at the top of a run directory anybody may put his own.
                pool = stored if number % 2 == 0 else [p for p in others if name != "extra" or "/" in p]
                touched = fault(root, pool, chooser)
                problem = judge(root, whole, touched, name)
                n_all, n_good = n_all + 1, n_good + (not problem)
                if problem:
                    wrong.append(f"{name} {touched}: {problem}")
                restore(root, whole)
            print(f"  {name}: {n_good} of {2 * asked.n} found and put right", flush=True)
        assert call("verify", root)[0] == 0
    for problem in wrong[:10]:
        print(problem)
    print(
        f"R13 deleted, extra, swapped and renamed files found and put right: {n_all - len(wrong)} of {n_all}, bar all"
    )
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
