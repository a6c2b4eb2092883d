"""Is a run what it was, and can it be made so again?"""
