"""How much CPU time matching and committing a field takes: medians, run by hand.

    python benchmarks/bench_commit.py [--fields 16]

Fields of the smoke campaign with MR/1+SE; committing writes truth, detections, matches and links as files of --fields
fields, with read-back and fsync, and is divided by their number.
"""

from __future__ import annotations

import argparse
import statistics
import tempfile
import time
from pathlib import Path

from survey_mc.campaign import draw_field, expand, load_campaign
from survey_mc.run.stages import detect_on, match_on, stack, stored_truth, table_of
from survey_mc.store import Family, Piece, RunLayout, commit_piece
from survey_mc.store.layout import STORED_TABLES

CAMPAIGN = Path(__file__).parents[1] / "campaigns" / "smoke.toml"
REPEATS = 7


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--fields", type=int, default=16, help="fields in a file")
    n_fields = parser.parse_args().fields
    campaign = load_campaign(CAMPAIGN)
    for cell in expand(campaign):
        method = cell.methods[-1]
        rows: dict[str, list] = {name: [] for name in STORED_TABLES}
        seconds = []
        for number in range(n_fields):
            field = draw_field(campaign, cell, number)
            found = detect_on(campaign, method, field, number)
            match_on(campaign, cell, field, found)
            start = time.process_time()
            matched = match_on(campaign, cell, field, found)
            seconds.append(time.process_time() - start)
            for name, frame in zip(
                STORED_TABLES, (stored_truth(field), found, matched.match_rows, matched.link_rows), strict=True
            ):
                rows[name].append((number, frame))
        commits = []
        for _ in range(REPEATS):
            with tempfile.TemporaryDirectory() as folder:
                layout = RunLayout(Path(folder))
                start = time.process_time()
                for name in STORED_TABLES:
                    table = table_of(name, method.name)
                    commit_piece(layout, Piece(Family(name, "0" * 32), 0, n_fields), table, stack(rows[name], table))
                commits.append((time.process_time() - start) / n_fields)
        print(
            f"{cell.label}: match {1e3 * statistics.median(seconds):.1f} ms, commit of four tables in files of "
            f"{n_fields} fields {1e3 * statistics.median(commits):.1f} ms a field ({len(found)} detections)"
        )


if __name__ == "__main__":
    main()
