"""The stages of EWAVELET: transform, background ring, Gaussian sources."""
