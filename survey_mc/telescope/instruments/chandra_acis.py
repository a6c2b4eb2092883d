"""Chandra ACIS-I: four front-illuminated CCDs behind the High Resolution Mirror Assembly, on-axis performance.

Source   PSF: FWHM 0.5″ with the detector (Proposers' Observatory Guide Tab. 4.1; paper Fig. 1); half of the counts of
         0.5-2 keV within 0.42″ in orbit (Dewey 1999, HETG technical notes). Field: 16.9′ square, here its inner circle.
         Flux per rate: Tozzi et al. 2001, ApJ 562, 42 (photon index 1.4, N_H = 8e19 cm⁻²; counts of 2-7 keV for the
         flux of 2-10 keV). 7 counts in 130 ks are 2.5e-16 and 1.6e-15, where Giacconi et al. 2001, ApJ 551, 624 give
         2e-16 and 2e-15. Background: 0.07 and 0.16 ct/s for a chip of 8.3′ (Observatory Guide, Tab. "Approximate
         on-orbit standard grade background"). Vignetting: 0.82 at 1.5 keV and 0.70 at 4 keV, 10′ off axis
         (Observatory Guide Chap. 4, figure).
Limits   The real PSF grows fast off axis (half-energy radius ~1.5″ at 5′, ~4″ at 8′) and is that of the axis here:
         completeness holds within ~2′ of the axis and is too good beyond; psf_fwhm_arcsec and psf_hew_arcsec of a
         campaign can stand for another angle. Flux per rate, background, vignetting (±0.03) and off-axis widths are
         recalled, not read again. Flux per rate is of 2000; contamination has lowered the soft response since. Most of
         the background is particles and not vignetted; here it is. No chip gaps, dither or pile-up; the aimpoint is in
         the middle. A pixel of 1″ is two CCD pixels, wider than the PSF: a source is often one or two pixels.
"""

from __future__ import annotations

from survey_mc.telescope.instruments.instrument import Instrument, InstrumentBand

INSTRUMENT = Instrument(
    name="chandra_acis",
    label="Chandra ACIS-I",
    about="four front-illuminated CCDs; on-axis PSF at every angle, which flatters it beyond 2′",
    reference="Chandra Proposers' Observatory Guide Chap. 4, 6; Weisskopf et al. 2002, PASP 114, 1",
    n_pix=1024,
    scale_arcsec=1.0,
    psf_fwhm_arcsec=0.5,
    psf_hew_arcsec=0.84,
    field_of_view_arcmin=8.4,
    bands=(
        InstrumentBand(
            name="soft",
            energy_min_kev=0.5,
            energy_max_kev=2.0,
            background_cps_per_pix=2.8e-7,
            flux_per_rate_cgs=4.6e-12,
            vignetting=(-0.10, -0.08, 0.0, 0.0),
        ),
        InstrumentBand(
            name="hard",
            energy_min_kev=2.0,
            energy_max_kev=10.0,
            background_cps_per_pix=6.4e-7,
            flux_per_rate_cgs=2.9e-11,
            vignetting=(-0.16, -0.14, 0.0, 0.0),
        ),
    ),
)
