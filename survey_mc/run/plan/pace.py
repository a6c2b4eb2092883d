"""How many fields an order should have.

Idea     an order is what is lost when a process dies and what a worker is busy with while the others wait at the end,
         so it should take some seconds; and each costs the driver some milliseconds, so fast fields come in whole
         files. How long a field takes is learnt from the orders that are done. The last orders are halves, quarters
         and eighths of a file, so that no worker waits long for another's last. No result depends on it.
Limits   the driver joins what comes in parts, so many workers on fast fields get whole files to the end.
"""

from __future__ import annotations

from survey_mc.run.order import Outcome

ORDERS_PER_WORKER = 8  # enough to even out unequal fields, few enough to keep the overhead of an order small
ORDER_SECONDS = 15.0
FIRST_FIELDS = 8  # in an order of a cell of which nothing is known
# Seconds of joining the parts of a file over those of writing them: they are read, and written again in one piece.
# Measured 0.5 (small fields) to 2 (large ones).
PACKING_PER_COMMIT = 1.0


def block_size(n_fields: int, workers: int, per_file: int) -> int:
    """The most fields in an order: a whole file where there is much to do, fewer where workers would otherwise wait."""
    return max(1, min(per_file, n_fields // (ORDERS_PER_WORKER * max(workers, 1))))


class Pace:
    """most: fields in an order of fast fields. fixed: all orders have that many, whatever they take. n_fields, workers:
    what is to be done, and by how many."""

    def __init__(self, most: int, *, fixed: bool = False, n_fields: int = 0, workers: int = 1) -> None:
        self.most, self.fixed = most, fixed
        self.n_left, self.workers = n_fields, workers
        self._spent: dict[int, tuple[int, float]] = {}
        self._commit_s = self._all_s = 0.0

    def book(self, cell_index: int, n_fields: int, outcome: Outcome) -> None:
        """Learn from a finished order."""
        fields, wall_s = self._spent.get(cell_index, (0, 0.0))
        spent_s = sum(cost.wall_s for cost in outcome.costs.values())
        self._spent[cell_index] = fields + n_fields, wall_s + spent_s
        self._all_s += spent_s
        self._commit_s += sum(cost.wall_s for (_, stage), cost in outcome.costs.items() if stage == "commit")

    def hand_out(self, n_fields: int) -> None:
        """An order of that many fields is on its way."""
        self.n_left -= n_fields

    def _most_now(self) -> int:
        """The most fields that leave an order for every worker."""
        most, others = self.most, self.workers - 1
        # A file for each of the others is joined; half of an order is not waited for.
        if others > 0 and others * PACKING_PER_COMMIT * self._commit_s < self._all_s / 2.0:
            while most > FIRST_FIELDS and most * self.workers > self.n_left:
                most = (most + 1) // 2
        return most

    def block(self, cell_index: int) -> int:
        """Fields in the next order of a cell."""
        if self.fixed:
            return self.most
        fields, wall_s = self._spent.get(cell_index, (0, 0.0))
        if not fields:
            return min(self.most, FIRST_FIELDS)
        return max(1, min(self._most_now(), int(ORDER_SECONDS * fields / max(wall_s, 1e-9))))
