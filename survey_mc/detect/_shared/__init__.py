"""Kernels that several procedures share."""
