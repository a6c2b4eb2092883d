"""The stages of WAVDETECT: transform, thresholds, source cells."""
