"""R12: every kind of file is cut at random places; what comes of it is an error with a name, or is repaired.

For each kind (stored file, manifest, lock, campaign, input, journal, table, their list, report) a small finished run is
verified, its status asked, a run of the campaign planned and a repair made with one file cut; then all its bytes have
to be as before. The sky image and the campaign that a person gives are cut beside the run and validated. Nothing may
end in a traceback. A manifest or journal that is cut at the end of a line looks like that of a killed run and is no
damage: stored files that lost their line are left over, which the repair makes good. Only some of the cut tables and
pages are repaired (--report-every), because a report takes seconds. 100 cuts of each kind take about a quarter of an
hour.
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

from damaged_runs import SKY_IMAGE, call, contents, kind_of_file, make_run, restore

IMAGE_END = 2880 + 16 * 16 * 4  # of the pixels; the rest of the file is padding
GIVEN = "given sky image", "given campaign"


class Cutter:
    """Cuts files of one run and says what the commands make of it."""

    def __init__(self, folder: Path, report_every: int) -> None:
        self.root = make_run(folder)
        self.campaign = folder / "damaged.toml"
        self.whole = contents(self.root)
        self.report_every = report_every
        self.n_reports = 0

    def cut_given(self, path: Path, size: int) -> str:
        """What `validate` makes of a cut file of the user's: "refused" or what is wrong with the answer."""
        content = path.read_bytes()
        path.write_bytes(content[:size])
        try:
            code, said = call("validate", self.campaign)
            if code == 0 and path.suffix == ".fits" and size < IMAGE_END:
                return "an image without its last pixels was taken"
        except Exception as problem:
            return f"traceback: {problem!r}"
        finally:
            path.write_bytes(content)
        named = path.name in said and "Traceback" not in said
        # A campaign that lost the last lines may be one by itself.
        return "refused" if code == 2 and named else "still valid" if code == 0 else f"exit {code}: {said[:200]}"

    def cut(self, path: str, size: int) -> str:
        """How a cut file of the run is found ("damaged", "left over", "harmless"), or what went wrong."""
        (self.root / path).write_bytes(self.whole[path][:size])
        try:
            return self._judge(path, size)
        except Exception as problem:
            return f"traceback: {problem!r}"
        finally:
            restore(self.root, self.whole)

    def _judge(self, path: str, size: int) -> str:
        code, said = call("verify", self.root)
        found = "damaged" if code == 4 else "left over" if "left over" in said else "harmless"
        line_end = size == 0 or self.whole[path][size - 1 : size] == b"\n"
        may_look_killed = kind_of_file(path) in ("manifest", "journal")
        if found != "damaged" and not may_look_killed:
            return f"not found: exit {code}: {said[:200]}"
        if found == "harmless" and kind_of_file(path) == "manifest" and not line_end:
            return "lost lines of the manifest are not found"
        for verb in (("status", self.root), ("plan", self.campaign, "--out", self.root)):
            if call(*verb)[0] not in (0, 2, 4):
                return f"{verb[0]} ended otherwise"
        if kind_of_file(path) in ("table", "report", "list of tables"):
            self.n_reports += 1
            if self.n_reports % self.report_every:
                return found
        return found if self._repaired(path) else "the repair did not give the same bytes"

    def _repaired(self, path: str) -> bool:
        code, said = call("verify", self.root, "--repair", "--serial")
        if kind_of_file(path) == "input":
            return code == 4 and Path(path).name in said and "put it back" in said
        after = contents(self.root)
        known = {name for name in self.whole if kind_of_file(name) != "journal"}
        return code == 0 and all(after.get(name) == self.whole[name] for name in known)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--n", type=int, default=100, help="cuts of each kind of file (default 100)")
    parser.add_argument("--report-every", type=int, default=25, help="repair every so many cut tables (default 25)")
    parser.add_argument("--seed", type=int, default=12)
    asked = parser.parse_args()
    chooser = random.Random(asked.seed)
    bad = 0
    with tempfile.TemporaryDirectory() as folder:
        cutter = Cutter(Path(folder), asked.report_every)
        by_kind: dict[str, list[str]] = {}
        for path, content in sorted(cutter.whole.items()):
            if content:
                by_kind.setdefault(kind_of_file(path), []).append(path)
        given = dict(zip(GIVEN, (Path(folder) / SKY_IMAGE, cutter.campaign), strict=True))
        for kind in (*by_kind, *given):
            found: Counter[str] = Counter()
            for _ in range(asked.n):
                if kind in given:
                    size = chooser.randrange(given[kind].stat().st_size)
                    found[cutter.cut_given(given[kind], size)] += 1
                else:
                    path = chooser.choice(by_kind[kind])
                    found[cutter.cut(path, chooser.randrange(len(cutter.whole[path])))] += 1
            good = ("damaged", "left over", "harmless", "refused", "still valid")
            bad += sum(number for outcome, number in found.items() if outcome not in good)
            print(f"  {kind}: " + ", ".join(f"{number} {outcome}" for outcome, number in found.items()), flush=True)
        n_all = asked.n * (len(by_kind) + len(given))
        assert call("verify", cutter.root)[0] == 0
    print(f"R12 cut files with a named error or repaired, without a traceback: {n_all - bad} of {n_all}, bar all")
    return 1 if bad else 0


if __name__ == "__main__":
    sys.exit(main())
