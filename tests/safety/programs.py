"""Programs that detectors may be made of: one that works, and ten that do not."""

from __future__ import annotations

import os
import sys
from pathlib import Path

# Reads a FITS image with nothing but the standard library, and writes X, Y (FITS pixels) and COUNTS of bright pixels.
WORKS = """
import csv, struct, sys
image, found, option = sys.argv[1:]
least = int(option.partition("=")[2])
content = open(image, "rb").read()
cards = {content[i:i+8].decode().strip(): content[i+10:i+30].decode().strip() for i in range(0, 2880, 80)}
n_x, n_y = int(cards["NAXIS1"]), int(cards["NAXIS2"])
counts = struct.unpack(f">{n_x * n_y}i", content[2880:2880 + 4 * n_x * n_y])
with open(found, "w", newline="") as stream:
    table = csv.writer(stream)
    table.writerow(("X", "Y", "COUNTS"))
    table.writerows((place % n_x + 1, place // n_x + 1, n) for place, n in enumerate(counts) if n >= least)
print(f"{image}: {n_x} x {n_y} pixels")
"""

# What each does instead; a piece of the sentence that says so.
FAULTS = {
    "hangs": (
        "import time; time.sleep(1000)",
        "did not end within 0.5 s and was stopped; it printed nothing",
    ),
    "hangs and ignores SIGTERM": (
        "import signal, time\nsignal.signal(15, signal.SIG_IGN)\nprint('still here', flush=True)\ntime.sleep(1000)",
        "did not end within 0.5 s and was stopped; its last words: still here",
    ),
    "prints without end": (
        "import os\nfor number in range(N_MEGABYTES): os.write(1, b'x' * 1_000_000)\nos._exit(1)",
        "ended with exit code 1; its last words: xxx",
    ),
    "writes other columns": (
        "open('found.csv', 'w').write('RA,DEC\\n1,2\\n')",
        "KeyError: 'X'",
    ),
    "leaves children that hold its output": (
        "import subprocess, sys\nsleep = [sys.executable, '-c', 'import time; time.sleep(1000)']\n"
        "for number in range(3): subprocess.Popen(sleep, start_new_session=number == 1)\nsys.exit(1)",
        "ended with exit code 1",
    ),
    "leaves a link instead of a file": (
        "import os; os.symlink('/etc/passwd', 'found.csv')",
        "is a link out of the working folder",
    ),
    "prints no UTF-8": (
        "import os; os.write(1, b'\\xff\\xfe caf\\xe9\\x1b[31m\\n'); os._exit(2)",
        "ended with exit code 2; its last words",
    ),
    "crashes": (
        "import os; print('so long', flush=True); os.kill(os.getpid(), 11)",
        "was ended by signal SIGSEGV; its last words: so long",
    ),
    "fills the disk": (
        "open('found.csv', 'wb').truncate(2**40)",
        "File too large",
    ),
    "writes nothing and says nothing": (
        "pass",
        "ended well but wrote no found.csv; it printed nothing",
    ),
}


def install(folder: Path, code: str, n_megabytes: int = 20) -> str:
    """Make `brightpix` in a folder; a PATH that finds it."""
    program = folder / "brightpix"
    program.write_text(f"#!{sys.executable} -S\n{code.replace('N_MEGABYTES', str(n_megabytes))}\n")
    program.chmod(0o755)
    return f"{folder}{os.pathsep}{os.environ['PATH']}"
