"""What a run has done so far, and whether a process is at work on it."""
