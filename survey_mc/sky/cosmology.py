"""Angular size of a length at a redshift.

Source   eds50: Einstein-de Sitter with H₀ = 50 km/s/Mpc, the paper's cosmology (Sect. 2, Tab. 2), in closed form:
         D_A = (2c/H₀) [1 − (1+z)^−½] / (1+z). planck18: flat ΛCDM of Planck Collaboration 2020, from astropy.
"""

from __future__ import annotations

import math
from typing import Literal

CosmologyName = Literal["eds50", "planck18"]

EDS50_H0 = 50.0  # km/s/Mpc
SPEED_OF_LIGHT_KM_S = 299792.458
KPC_PER_MPC = 1000.0


def hubble_constant(cosmology: CosmologyName) -> float:
    """H₀ in km/s/Mpc."""
    if cosmology == "eds50":
        return EDS50_H0
    from astropy.cosmology import Planck18

    return float(Planck18.H0.value)


def angular_diameter_distance_mpc(redshift: float, cosmology: CosmologyName) -> float:
    """D_A in Mpc; redshift > 0."""
    if cosmology == "eds50":
        hubble_length_mpc = SPEED_OF_LIGHT_KM_S / EDS50_H0
        return 2.0 * hubble_length_mpc * (1.0 - 1.0 / math.sqrt(1.0 + redshift)) / (1.0 + redshift)
    from astropy.cosmology import Planck18

    return float(Planck18.angular_diameter_distance(redshift).value)


def angle_arcsec(length_kpc: float, redshift: float, cosmology: CosmologyName) -> float:
    """Angle under which a length is seen."""
    radians = length_kpc / KPC_PER_MPC / angular_diameter_distance_mpc(redshift, cosmology)
    return math.degrees(radians) * 3600.0
