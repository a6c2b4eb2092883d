"""Reading counts images: what is accepted is read exactly, what is not is refused in one sentence."""

import gzip
import os
import subprocess
import sys
import warnings

import numpy as np
import pytest
from astropy.io import fits
from astropy.wcs import WCS
from fits_samples import SCALE_ARCSEC, SHAPE, sample_counts, sky_header, write_image

from survey_mc.errors import BadInput
from survey_mc.fits import read_counts_image


def refusal(path, *args, **options):
    with pytest.raises(BadInput) as caught:
        read_counts_image(path, *args, **options)
    message = str(caught.value)
    assert str(path) in message
    assert "\n" not in message
    return message


@pytest.mark.parametrize("packed", [False, True])
@pytest.mark.parametrize("dtype", ["uint8", "int16", "int32", "int64", "uint16", "uint32", "float32", "float64"])
def test_counts_are_read_exactly_whatever_their_storage(tmp_path, dtype, packed):
    path = write_image(tmp_path / "a.fits", sample_counts().astype(dtype), packed=packed, checksum=True)
    image = read_counts_image(path)
    assert image.counts.dtype == np.int32
    assert not image.counts.flags.writeable
    np.testing.assert_array_equal(image.counts, sample_counts())


@pytest.mark.parametrize("hdu", [None, 1, "1", "SCI", "sci"])
def test_image_in_an_extension_is_found(tmp_path, hdu):
    path = write_image(tmp_path / "a.fits", extension=True)
    np.testing.assert_array_equal(read_counts_image(path, hdu).counts, sample_counts())


def test_single_plane_cube_is_an_image(tmp_path):
    path = write_image(tmp_path / "a.fits", sample_counts()[None])
    np.testing.assert_array_equal(read_counts_image(path).counts, sample_counts())


@pytest.mark.parametrize("style", ["CD", "PC"])
@pytest.mark.parametrize(("rotation_deg", "mirrored"), [(0.0, False), (37.0, False), (200.0, True)])
def test_pixel_scale_is_measured_from_any_matrix(tmp_path, style, rotation_deg, mirrored):
    header = sky_header(style=style, rotation_deg=rotation_deg, mirrored=mirrored)
    image = read_counts_image(write_image(tmp_path / "a.fits", header=header))
    assert image.grid.scale_arcsec == pytest.approx(SCALE_ARCSEC, rel=1e-6)
    theirs = WCS(header).pixel_to_world_values(3.2, 17.9)
    np.testing.assert_allclose(image.grid.wcs.pixel_to_world_values(3.2, 17.9), theirs, rtol=0, atol=1e-12)


def test_crota_is_understood(tmp_path):
    header = sky_header(style="PC")
    for key in ("PC1_1", "PC1_2", "PC2_1", "PC2_2"):
        del header[key]
    header.update({"CDELT1": -SCALE_ARCSEC / 3600.0, "CROTA2": 25.0})
    image = read_counts_image(write_image(tmp_path / "a.fits", header=header))
    np.testing.assert_allclose(
        image.grid.wcs.pixel_to_world_values(0, 0), WCS(header).pixel_to_world_values(0, 0), atol=1e-12
    )


def test_optical_axis_is_the_pointing_if_on_the_image_else_the_centre(tmp_path):
    header = sky_header()
    ra_deg, dec_deg = (float(v) for v in WCS(header).pixel_to_world_values(4.0, 9.0))
    pointed = write_image(tmp_path / "a.fits", header=sky_header(RA_PNT=ra_deg, DEC_PNT=dec_deg))
    elsewhere = write_image(tmp_path / "b.fits", header=sky_header(RA_PNT=ra_deg + 180.0, DEC_PNT=dec_deg))
    assert read_counts_image(pointed).grid.axis_pix == pytest.approx((4.0, 9.0), abs=1e-6)
    assert read_counts_image(elsewhere).grid.axis_pix == (15.5, 11.5)
    assert read_counts_image(pointed, axis_pix=(1.0, 2.0)).grid.axis_pix == (1.0, 2.0)


def test_without_wcs_the_pixel_scale_must_be_given(tmp_path):
    path = write_image(tmp_path / "a.fits", header=fits.Header())
    assert "no WCS where one is needed" in refusal(path)
    grid = read_counts_image(path, pixel_scale_arcsec=2.5).grid
    assert (grid.scale_arcsec, grid.wcs, grid.shape) == (2.5, None, SHAPE)


@pytest.mark.parametrize(
    ("cards", "band_kev"),
    [
        ({"E_MIN": 0.5, "E_MAX": 2.0}, (0.5, 2.0)),
        ({"E_MIN": 500, "E_MAX": 2000}, (0.5, 2.0)),
        ({"E_MIN": 20.0, "E_MAX": 90.0, "E_UNIT": "eV"}, (0.02, 0.09)),
        ({"PIMIN": 2000, "PIMAX": 10000}, (2.0, 10.0)),
        ({"DSTYP2": "PI", "DSUNI2": "eV", "DSVAL2": "500:2000"}, (0.5, 2.0)),
        ({"DSTYP2": "PI", "DSUNI2": "CHAN", "DSVAL2": "500:2000", "TELESCOP": "XMM"}, (0.5, 2.0)),
        ({"DSTYP2": "PI", "DSUNI2": "CHAN", "DSVAL2": "500:2000", "TELESCOP": "OTHER"}, (None, None)),
        ({"E_MIN": 2.0, "E_MAX": 0.5}, (None, None)),
        ({}, (None, None)),
    ],
)
def test_energy_band_is_in_kev_from_the_dialects_of_the_field(tmp_path, cards, band_kev):
    facts = read_counts_image(write_image(tmp_path / "a.fits", header=sky_header(**cards))).facts
    assert (facts.energy_min_kev, facts.energy_max_kev) == (pytest.approx(band_kev) if band_kev[0] else band_kev)
    assert bool(facts.notes) == (cards.get("E_MIN") == 2.0)


def test_facts_come_from_the_image_then_from_the_primary_header(tmp_path):
    units = [fits.PrimaryHDU(), fits.ImageHDU(sample_counts(), sky_header(EXPOSURE=9000.0))]
    units[0].header.update({"TELESCOP": "XMM", "INSTRUME": "EPN", "OBS_ID": "0123", "EXPOSURE": 1.0})
    fits.HDUList(units).writeto(tmp_path / "a.fits")
    facts = read_counts_image(tmp_path / "a.fits").facts
    assert (facts.telescope, facts.instrument, facts.obs_id, facts.exposure_s) == ("XMM", "EPN", "0123", 9000.0)
    assert facts.file_name == "a.fits"


def poke(values, value):
    spoilt = values.astype(np.float64)
    spoilt[5, 9] = value
    return spoilt


@pytest.mark.parametrize(
    ("value", "words"),
    [
        (np.nan, "counts must be finite; 1 pixel is not (got nan at FITS pixel 10, 6)"),
        (np.inf, "counts must be finite"),
        (-1.0, "counts must not be negative; 1 pixel is not (got -1 at FITS pixel 10, 6)"),
        (1.5, "counts must be whole numbers"),
        (1e-5, "counts must be whole numbers"),
        (2.0**31, "counts must be at most 2147483647"),
        (1e300, "counts must be at most 2147483647"),
    ],
)
def test_pixel_that_is_no_photon_count_is_refused_with_its_place(tmp_path, value, words):
    assert words in refusal(write_image(tmp_path / "a.fits", poke(sample_counts(), value)))


@pytest.mark.parametrize("value", [2.0**31 - 1, 3.0 + 5e-7, -0.0])
def test_pixel_at_the_edge_of_the_allowed_is_read(tmp_path, value):
    assert read_counts_image(write_image(tmp_path / "a.fits", poke(sample_counts(), value))).counts[5, 9] == round(
        value
    )


def test_blank_pixels_are_not_counts(tmp_path):
    assert "must be finite" in refusal(write_image(tmp_path / "a.fits", header=sky_header(BLANK=0)))


@pytest.mark.parametrize(
    ("values", "words"),
    [
        (np.arange(9), "two-dimensional"),
        (np.zeros((2, 9, 9), dtype=np.int16), "two-dimensional"),
        (np.zeros((0, 9), dtype=np.int16), "empty"),
    ],
)
def test_image_must_have_two_dimensions_and_pixels(tmp_path, values, words):
    assert words in refusal(write_image(tmp_path / "a.fits", values, fits.Header()))


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"CD1_1": -SCALE_ARCSEC / 3600.0 * 1.03}, "pixels must be square"),
        ({"CD1_2": SCALE_ARCSEC / 3600.0 * 0.03}, "pixels must be square"),
        ({"CD1_1": 0.0}, "pixels must be square"),
        ({"CD1_1": -1.0, "CD2_2": 1.0}, "one size"),
        ({"CTYPE2": "FREQ"}, "WCS"),
        ({"CTYPE1": 7}, "CTYPE1 must be text"),
        ({"CRPIX1": "left"}, "CRPIX1 must be a finite number"),
        ({"CTYPE1": "GLON-TAN"}, "WCS"),
        ({"CTYPE1": "RA---TAN-SIP", "CTYPE2": "DEC--TAN-SIP", "A_ORDER": 10**6}, "A_ORDER must be 0..9"),
    ],
)
def test_unusable_wcs_is_refused(tmp_path, change, words):
    assert words in refusal(write_image(tmp_path / "a.fits", header=sky_header(**change)))


def test_wcs_without_pixel_size_is_refused(tmp_path):
    header = sky_header()
    for key in ("CD1_1", "CD1_2", "CD2_1", "CD2_2"):
        del header[key]
    assert "no pixel size" in refusal(write_image(tmp_path / "a.fits", header=header))


@pytest.mark.parametrize("scale_arcsec", [4.2, -4.0, 0.0, np.nan, np.inf])
def test_pixel_scale_argument_must_agree_with_the_wcs(tmp_path, scale_arcsec):
    assert "pixel scale" in refusal(write_image(tmp_path / "a.fits"), pixel_scale_arcsec=scale_arcsec)


def test_files_that_are_no_files_are_refused(tmp_path):
    assert "no such file" in refusal(tmp_path / "missing.fits")
    assert "is a directory" in refusal(tmp_path)
    assert "cannot be read" in refusal(tmp_path / ("x" * 300))
    assert "cannot be read" in refusal(f"{tmp_path}/a\0b.fits")
    (tmp_path / "empty.fits").write_bytes(b"")
    assert "is empty" in refusal(tmp_path / "empty.fits")
    (tmp_path / "text.fits").write_text("to whom it may concern\n" * 999)
    assert "not a FITS file" in refusal(tmp_path / "text.fits")
    os.mkfifo(tmp_path / "pipe.fits")
    assert "not a regular file" in refusal(tmp_path / "pipe.fits")


def test_names_with_spaces_and_letters_of_all_lands_work(tmp_path):
    for name in ("two words.fits", "été Σ 星.fits", "x" * 250 + ".fits"):
        assert read_counts_image(write_image(tmp_path / name)).facts.file_name == name


def test_file_without_image_lists_what_it_has(tmp_path):
    events = fits.BinTableHDU.from_columns([fits.Column("X", "J", array=[1, 2])], name="EVENTS")
    fits.HDUList([fits.PrimaryHDU(), events]).writeto(tmp_path / "a.fits")
    message = refusal(tmp_path / "a.fits")
    assert "no image" in message
    assert "1: EVENTS (table)" in message
    assert "is a table, expected an image" in refusal(tmp_path / "a.fits", "EVENTS")
    assert "there is no HDU 5" in refusal(tmp_path / "a.fits", 5)
    assert "there is no HDU 'NONE'" in refusal(tmp_path / "a.fits", "NONE")


def test_tile_compressed_image_is_refused_with_advice(tmp_path):
    fits.HDUList([fits.PrimaryHDU(), fits.CompImageHDU(sample_counts())]).writeto(tmp_path / "a.fits")
    assert "funpack" in refusal(tmp_path / "a.fits")


def edited(path, offset, content):
    whole = bytearray(path.read_bytes())
    whole[offset : offset + len(content)] = content
    path.write_bytes(bytes(whole))
    return path


def test_changed_pixel_under_a_checksum_is_refused(tmp_path):
    path = write_image(tmp_path / "a.fits", checksum=True)
    read_counts_image(path)
    assert "damaged or was edited" in refusal(edited(path, 2880 + 4 * 100, b"\0\0\0\x09"))


def test_changed_header_under_a_checksum_is_refused(tmp_path):
    path = write_image(tmp_path / "a.fits", checksum=True)
    place = path.read_bytes().index(b"CRVAL1")
    assert "CHECKSUM does not agree" in refusal(edited(path, place + 25, b"7"))


def header_block(**cards):
    lines = [f"{key:8s}= {value:>20}" for key, value in {"SIMPLE": "T", **cards}.items()]
    return ("".join(f"{line:80s}" for line in [*lines, "END"])).encode().ljust(2880)


@pytest.mark.parametrize("packed", [False, True])
@pytest.mark.parametrize(
    ("cards", "words"),
    [
        ({"BITPIX": 8, "NAXIS": 2, "NAXIS1": 100000, "NAXIS2": 10000}, "at most"),
        ({"BITPIX": -64, "NAXIS": 2, "NAXIS1": 10**18, "NAXIS2": 10**18}, "at most"),
        ({"BITPIX": 32, "NAXIS": 2, "NAXIS1": 8000, "NAXIS2": 8000}, "truncated"),
        ({"BITPIX": 32, "NAXIS": 2, "NAXIS1": -5, "NAXIS2": 8000}, "NAXIS1"),
        ({"BITPIX": 32, "NAXIS": 3, "NAXIS1": 5, "NAXIS2": 8}, "NAXIS3"),
        ({"BITPIX": 32, "NAXIS": 99999}, "NAXIS"),
        ({"BITPIX": 17, "NAXIS": 2, "NAXIS1": 5, "NAXIS2": 8}, "BITPIX"),
        ({"BITPIX": 32, "NAXIS": "'two'"}, "NAXIS must be an integer"),
    ],
)
def test_header_that_promises_too_much_is_refused_before_allocation(tmp_path, cards, words, packed):
    content = header_block(**cards) + bytes(2880)
    path = tmp_path / "a.fits"
    path.write_bytes(gzip.compress(content) if packed else content)
    assert words in refusal(path)


def test_gzip_bomb_is_refused_unopened(tmp_path):
    table = {
        "XTENSION": "'BINTABLE'",
        "BITPIX": 8,
        "NAXIS": 2,
        "NAXIS1": 10**6,
        "NAXIS2": 10**6,
        "PCOUNT": 0,
        "GCOUNT": 1,
    }
    extension = header_block(**table)[80:].ljust(2880)
    image = header_block(BITPIX=8, NAXIS=2, NAXIS1=20, NAXIS2=20) + bytes(2880)
    path = tmp_path / "bomb.fits.gz"
    path.write_bytes(gzip.compress(image + extension + bytes(2880 * 10**4)))
    assert "at most 536870912 are unpacked" in refusal(path)


def test_endless_header_is_refused(tmp_path):
    (tmp_path / "a.fits").write_bytes(header_block(BITPIX=8, NAXIS=0).replace(b"END", b"   ") * 1001)
    assert "no END card" in refusal(tmp_path / "a.fits")


def test_junk_after_the_last_unit_is_refused_but_padding_is_not(tmp_path):
    path = write_image(tmp_path / "a.fits")
    whole = path.read_bytes()
    path.write_bytes(whole + bytes(512))
    read_counts_image(path)
    path.write_bytes(whole + b"left over")
    assert "what follows the last HDU" in refusal(path)


def test_oddities_of_headers_do_not_speak_to_the_user(tmp_path):
    header = sky_header(EXPOSURE="unknown", DATE="yesterday", EQUINOX=2000.0, RADECSYS="FK5")
    path = write_image(tmp_path / "a.fits", header=header)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        image = read_counts_image(path)
    assert image.facts.exposure_s is None
    assert "EXPOSURE must be a finite number" in image.facts.notes[0]


def test_distortion_coefficients_hold_only_when_the_projection_names_them(tmp_path, capfd):
    sip = {"A_ORDER": 2, "B_ORDER": 2, "A_2_0": 1e-4, "B_1_1": 1e-4}
    plain = read_counts_image(write_image(tmp_path / "a.fits", header=sky_header(**sip))).grid.wcs
    named = sky_header(CTYPE1="RA---TAN-SIP", CTYPE2="DEC--TAN-SIP", **sip)
    distorted = read_counts_image(write_image(tmp_path / "b.fits", header=named)).grid.wcs
    np.testing.assert_allclose(plain.all_pix2world(0, 0, 0), WCS(sky_header()).all_pix2world(0, 0, 0), atol=1e-12)
    np.testing.assert_allclose(distorted.all_pix2world(0, 0, 0), WCS(named).all_pix2world(0, 0, 0), atol=1e-12)
    assert capfd.readouterr() == ("", "")


def test_importing_the_room_does_not_import_astropy():
    code = "import survey_mc.fits, sys; sys.exit('astropy' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
