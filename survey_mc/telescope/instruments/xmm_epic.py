"""XMM-Newton EPIC: pn + MOS1 + MOS2 summed, thin filters, as the paper simulates it.

Source   paper Tab. 1 (scale, size, PSF, background), Sect. 2 (vignetting at 10′), Tab. 8 (flux per rate).
Limits   no chip gaps, flares, out-of-time events or pile-up (paper Sect. 2). The backgrounds are the per-pixel ones;
         the paper's per-arcmin² figures are 2 % larger than 225 such pixels. Tab. 8 heads the flux per rate
         "cts/s per flux"; its own check (90 photons at 6e-16 in 100 ks) shows the inverse.
"""

from __future__ import annotations

from survey_mc.telescope.instruments.instrument import Instrument, InstrumentBand

INSTRUMENT = Instrument(
    name="xmm_epic",
    label="XMM-Newton EPIC (pn + 2 MOS)",
    about="three cameras summed, thin filters; PSF independent of angle and energy",
    reference="Valtchanov, Pierre & Gastaud 2001, A&A 370, 689, Tab. 1",
    n_pix=512,
    scale_arcsec=4.0,
    psf_fwhm_arcsec=6.0,
    psf_hew_arcsec=15.0,
    field_of_view_arcmin=15.0,
    bands=(
        InstrumentBand(
            name="soft",
            energy_min_kev=0.5,
            energy_max_kev=2.0,
            background_cps_per_pix=1.78e-5,
            flux_per_rate_cgs=6.70e-13,
            vignetting=(0.0, -1.0700256, 0.7674334, -0.1674078),
        ),
        InstrumentBand(
            name="hard",
            energy_min_kev=2.0,
            energy_max_kev=10.0,
            background_cps_per_pix=2.4e-5,
            flux_per_rate_cgs=3.66e-12,
            vignetting=(0.0, -1.3103369, 1.0450687, -0.2547317),
        ),
    ),
)
