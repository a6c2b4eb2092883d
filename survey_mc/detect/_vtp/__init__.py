"""The stages of VTPDETECT: tessellation, flux law, percolation."""
