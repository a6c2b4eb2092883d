"""SExtractor's chain, the common end of the mixed procedures."""
