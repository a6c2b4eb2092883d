"""Programs of others, for authors of detectors: run in a private folder, their files taken, nothing left behind.

Idea     one call, `run_program`; what goes wrong is a `ProgramFailed` with the program's name, its end and its last
         words.
"""

from survey_mc.external.program import ProgramFailed, ProgramResult, run_program

__all__ = ["ProgramFailed", "ProgramResult", "run_program"]
