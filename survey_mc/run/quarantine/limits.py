"""How long a procedure may work on a field, and how much memory it may take.

Idea     limits are about running and not about physics: they enter no key, and a field that is within them has the same
         bytes under any. A procedure that needs more is stopped on that field alone.
Limits   memory is limited for the whole process (RLIMIT_DATA), so that an allocation beyond it is a MemoryError of the
         procedure that asked for it; systems without that limit have none.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass

from survey_mc.errors import BadInput

DEFAULT_SECONDS = 600.0
DEFAULT_MEMORY_MB = 4096
LEAST_MEMORY_MB = 600  # a worker with all procedures compiled has mapped half of it
# Compilation of a procedure is booked on no field: its rehearsal may take this much longer.
COMPILATION_SECONDS = 120.0
BYTES_PER_MB = 1024 * 1024


@dataclass(frozen=True, slots=True)
class FieldLimits:
    """seconds: of one stage of one procedure on one field. memory_mb: data of a whole worker process. 0: no limit."""

    seconds: float = DEFAULT_SECONDS
    memory_mb: int = DEFAULT_MEMORY_MB

    def __post_init__(self) -> None:
        if not (self.seconds == 0.0 or 0.1 <= self.seconds <= 1e7):
            raise BadInput("run", f"--field-timeout must be 0 (none) or 0.1..1e7 seconds (got {self.seconds:g})")
        if not (self.memory_mb == 0 or LEAST_MEMORY_MB <= self.memory_mb <= 10_000_000):
            raise BadInput(
                "run", f"--memory-limit must be 0 (none) or {LEAST_MEMORY_MB}..10000000 MB (got {self.memory_mb})"
            )


@contextmanager
def limited_memory(limits: FieldLimits) -> Iterator[None]:
    """Let this process have no more than `memory_mb` of data for the time being; what a stricter limit forbids stays
    forbidden."""
    import resource

    if not limits.memory_mb or not hasattr(resource, "RLIMIT_DATA"):
        yield
        return
    soft, hard = resource.getrlimit(resource.RLIMIT_DATA)
    wanted = limits.memory_mb * BYTES_PER_MB
    if soft == resource.RLIM_INFINITY or wanted < soft:
        resource.setrlimit(resource.RLIMIT_DATA, (wanted, hard))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_DATA, (soft, hard))
