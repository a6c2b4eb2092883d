"""The stages of EMLDETECT: sliding cell, background, maximum-likelihood fits."""
