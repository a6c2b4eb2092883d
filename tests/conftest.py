"""Property tests draw the same examples on every machine and have no time limit: a busy machine is not a failure."""

from hypothesis import settings

settings.register_profile("steady", deadline=None, derandomize=True)
settings.load_profile("steady")
