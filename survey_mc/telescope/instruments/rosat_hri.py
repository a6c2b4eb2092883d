"""ROSAT HRI: the X-ray telescope with the High Resolution Imager, one band.

Source   PSF: on-axis formula of the ROSAT status report 85 (HEASARC, February 1994),
         0.96 exp(−½(r/2.18″)²) + 0.18 exp(−½(r/4.04″)²) + 0.0009 exp(−r/31.7″), whose FWHM is 5.55″ and half-energy
         width 6.96″ (the 1.7″ of the paper's Fig. 1 is the detector alone).
         Flux per rate: ROSAT Users' Handbook Tab. 5.11, power law of photon index 2, N_H = 10^19.7 cm⁻²: 0.141 ct/s in
         the cell with half of the photons for 1e-11 erg/cm²/s in 0.1-2.4 keV, unabsorbed, so 3.55e-11 for one ct/s in
         all; ln 4/ln 24 of that flux lies in 0.5-2 keV.
         Background: 3.8e-3 ct/s/arcmin², typical total (handbook of the first call, Tab. 4.3). Vignetting at 1 keV:
         1 − 1.49e-3 θ − 2.47e-4 θ² (David et al., HRI Calibration Report).
         Field: the inner 15′ of 19′; beyond 12′ the images are very asymmetric (Users' Handbook Sect. 5.2.2).
Limits   The HRI has no energy resolution: the photons counted, source and background, are those of 0.1-2.4 keV; only
         the flux is quoted in 0.5-2 keV, for the spectrum above. Background and vignetting coefficients are recalled,
         not read again; read were "less than 10 % within 10′" and ~5 ct/s over the 38′ detector, which they obey.
         Most of the background is particles and not vignetted; here it is, 8 % at 15′. The PSF is on axis everywhere;
         the King profile lacks the formula's halo: it encircles up to 0.09 more, most at 19″.
"""

from __future__ import annotations

from survey_mc.telescope.instruments.instrument import Instrument, InstrumentBand

INSTRUMENT = Instrument(
    name="rosat_hri",
    label="ROSAT HRI",
    about="one band: counts of 0.1-2.4 keV, fluxes of 0.5-2 keV; on-axis PSF at every angle",
    reference="ROSAT status report 85 (1994); ROSAT Users' Handbook Sect. 5; Truemper 1982, Adv. Space Res. 2, 241",
    n_pix=1024,
    scale_arcsec=2.0,
    psf_fwhm_arcsec=5.547,
    psf_hew_arcsec=6.960,
    field_of_view_arcmin=15.0,
    bands=(
        InstrumentBand(
            name="soft",
            energy_min_kev=0.5,
            energy_max_kev=2.0,
            background_cps_per_pix=4.22e-6,
            flux_per_rate_cgs=1.547e-11,
            vignetting=(-0.0149, -0.0247, 0.0, 0.0),
        ),
    ),
)
