"""Catalogues, region files and simulated fields: what is written can be read, here and by other programs."""

import json
import os
import stat
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from astropy import units
from astropy.coordinates import SkyCoord
from astropy.io import fits
from astropy.table import Table
from astropy.wcs import WCS
from fits_samples import (
    SCALE_ARCSEC,
    SamplePsf,
    sample_counts,
    sample_detections,
    sample_field,
    sample_observation,
    sky_header,
    write_image,
)

from survey_mc.array_frame import ArrayFrame
from survey_mc.columns import DETECTIONS, Column
from survey_mc.detect.detector import Detector, DetectorParams
from survey_mc.errors import BadInput
from survey_mc.fits import (
    ImageFacts,
    observation_from_files,
    read_catalogue,
    read_counts_image,
    read_exposure_map,
    read_regions,
    write_catalogue,
    write_regions,
    write_simulated_field,
)

X_PIX, Y_PIX = [3.0, 15.5, 28.25], [4.0, 11.5, 20.75]


class SampleParams(DetectorParams):
    radius_arcsec: float = 8.0
    scales: tuple[int, ...] = (1, 2, 4)
    keep_edges: bool = True
    background: str | None = None
    long_name_of_a_parameter_that_does_not_fit_on_one_card: str = "x" * 70


EXTRA = (Column("sigma_clip", "float64", "σ of β × 2 − 1", "arcsec"), Column("shape_class", "string", "a word"))
DETECTOR = Detector(
    "sample", "Sample", 3, "finds nothing", "Someone 1999, A&A 1, 1", SampleParams, None, SampleParams(), EXTRA
)


def sky_observation(tmp_path, **cards):
    return sample_observation(read_counts_image(write_image(tmp_path / "c.fits", header=sky_header(**cards))).grid)


def detections(n=3):
    return sample_detections(
        X_PIX[:n],
        Y_PIX[:n],
        counts=np.arange(n) + 9.5,
        x_err_pix=np.full(n, 0.3),
        y_err_pix=np.full(n, 0.4),
        sigma_clip=np.arange(n) * 1.0,
        shape_class=["round", "é", ""][:n],
    )


def save(path, frame, observation, **options):
    facts = ImageFacts("c.fits", 1e4, 0.5, 2.0, "XMM", "EPN", obs_id="0123")
    write_catalogue(
        path, frame, detector=DETECTOR, params=SampleParams(), observation=observation, facts=facts, **options
    )
    return path


@pytest.mark.parametrize("name", ["cat.fits", "cat.fits.gz"])
@pytest.mark.parametrize("n", [0, 1, 3])
def test_catalogue_comes_back_as_it_was(tmp_path, n, name):
    path = save(tmp_path / name, detections(n), sky_observation(tmp_path))
    catalogue = read_catalogue(path)
    for column in DETECTIONS.columns[1:]:
        np.testing.assert_array_equal(catalogue.detections[column.name], detections(n)[column.name])
        assert catalogue.detections[column.name].dtype == column.dtype
    assert (catalogue.method, catalogue.version) == ("sample", 3)
    assert SampleParams.model_validate(catalogue.parameters) == SampleParams()


def test_catalogue_places_sources_where_the_wcs_says(tmp_path):
    observation = sky_observation(tmp_path, **{"CRVAL1": 0.001})
    path = save(tmp_path / "cat.fits", detections(), observation)
    table = Table.read(path)
    world = WCS(sky_header(CRVAL1=0.001)).wcs_pix2world(np.column_stack([table["X_IMAGE"], table["Y_IMAGE"]]), 1)
    there = SkyCoord(world, unit="deg")
    assert np.all(SkyCoord(table["RA"], table["DEC"]).separation(there).arcsec < 1e-6)
    np.testing.assert_array_equal(table["X_IMAGE"] - 1.0, X_PIX)
    np.testing.assert_array_equal(table["x_pix"], X_PIX)
    np.testing.assert_allclose(table["RADEC_ERR"], 0.5 * SCALE_ARCSEC, rtol=1e-6)
    assert table["RADEC_ERR"].unit == units.arcsec


def test_native_names_are_further_columns_with_the_same_values_units_and_meaning(tmp_path):
    detector = replace(DETECTOR, native_names={"SCTS": "counts", "SIGMA": "sigma_clip"})
    path = tmp_path / "cat.fits"
    write_catalogue(path, detections(), detector=detector, params=SampleParams(), observation=sky_observation(tmp_path))
    table, header = Table.read(path), fits.getheader(path, 1)
    ucd = {header[f"TTYPE{i}"]: header.get(f"TUCD{i}") for i in range(1, header["TFIELDS"] + 1)}
    for native, name in detector.native_names.items():
        np.testing.assert_array_equal(table[native], table[name])
        assert (table[native].unit, ucd[native]) == (table[name].unit, ucd[name])
    names = [name.lower() for name in table.colnames]
    assert len(set(names)) == len(names)
    assert header[f"TCOMM{table.colnames.index('SCTS') + 1}"] == "counts: source counts measured by the procedure"
    again = read_catalogue(path).detections
    assert again["SCTS"].tolist() == again["counts"].tolist() == detections()["counts"].tolist()


def test_catalogue_columns_carry_unit_ucd_and_meaning_that_others_understand(tmp_path):
    path = save(tmp_path / "cat.fits", detections(), sky_observation(tmp_path))
    assert fits.open(path, checksum=True)[1].verify_checksum() == 1
    header = fits.getheader(path, 1)
    names = [header[f"TTYPE{i}"] for i in range(1, header["TFIELDS"] + 1)]
    for number in range(1, len(names) + 1):
        assert header[f"TCOMM{number}"]
        units.Unit(header.get(f"TUNIT{number}", ""), format="fits")
    assert header[f"TUCD{names.index('RA') + 1}"] == "pos.eq.ra;meta.main"
    assert header[f"TCOMM{names.index('sigma_clip') + 1}"] == "sigma of beta x 2 - 1"
    assert header["SMC RADIUS_ARCSEC"] == 8.0
    assert header["SMC KEEP_EDGES"] is True
    assert json.loads(header["SMC SCALES"]) == [1, 2, 4]
    assert (header["IMAGE"], header["TELESCOP"], header["SMCMETH"], header["SMCVERS"]) == ("c.fits", "XMM", "sample", 3)
    assert "DATE" not in header
    assert header["CREATOR"].startswith("survey_mc")


def test_catalogue_without_wcs_has_no_sky_columns(tmp_path):
    path = save(tmp_path / "cat.fits", detections(), sample_observation())
    assert not {"RA", "DEC", "RADEC_ERR"} & set(read_catalogue(path).detections)


def test_equal_catalogues_are_equal_bytes(tmp_path):
    observation = sky_observation(tmp_path)
    first, second = (save(tmp_path / name, detections(), observation).read_bytes() for name in ("a.fits", "b.fits"))
    assert first == second


def test_foreign_tables_are_no_catalogues(tmp_path):
    Table({"a": [1]}).write(tmp_path / "t.fits")
    with pytest.raises(BadInput, match="there is no HDU 'DETECTIONS'"):
        read_catalogue(tmp_path / "t.fits")
    fits.HDUList([fits.PrimaryHDU(), fits.BinTableHDU(Table({"a": [1]}), name="DETECTIONS")]).writeto(
        tmp_path / "u.fits"
    )
    with pytest.raises(BadInput, match="not a catalogue of this program"):
        read_catalogue(tmp_path / "u.fits")


WRITERS = {
    "catalogue": lambda path, **options: save(path, detections(), sample_observation(), **options),
    "regions": lambda path, **options: write_regions(path, detections(), sample_observation(), **options),
    "field": lambda path, **options: write_simulated_field(path, sample_field(), **options),
}


@pytest.mark.parametrize("write", WRITERS.values(), ids=WRITERS)
def test_existing_file_is_kept_unless_overwriting_is_asked_for(tmp_path, write):
    path = tmp_path / "out"
    path.write_text("precious")
    with pytest.raises(BadInput, match="exists already"):
        write(path)
    assert path.read_text() == "precious"
    write(path, overwrite=True)
    assert path.read_bytes() != b"precious"
    assert os.listdir(tmp_path) == ["out"]
    assert stat.S_IMODE(path.stat().st_mode) & 0o600 == 0o600


@pytest.mark.parametrize("write", WRITERS.values(), ids=WRITERS)
def test_places_that_cannot_be_written_are_named(tmp_path, write):
    with pytest.raises(BadInput, match="does not exist"):
        write(tmp_path / "no" / "such" / "out")
    with pytest.raises(BadInput, match="is a directory"):
        write(tmp_path, overwrite=True)
    with pytest.raises(BadInput, match="cannot be written"):
        write(tmp_path / ("x" * 300))
    assert os.listdir(tmp_path) == []


def test_nothing_is_left_behind_when_the_disk_is_full(tmp_path, monkeypatch):
    def no_space(_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "fsync", no_space)
    with pytest.raises(BadInput, match=r"No space left on device; \d+ bytes are needed"):
        WRITERS["field"](tmp_path / "out.fits")
    assert os.listdir(tmp_path) == []


def test_regions_without_wcs_are_circles_in_fits_pixels(tmp_path):
    frame = detections().assign(r50_arcsec=[np.nan, 4.0, 30.0])
    write_regions(tmp_path / "a.reg", frame, sample_observation(), colour="cyan", title="Schöne Quellen")
    regions = read_regions(tmp_path / "a.reg")
    assert [(r.x, r.y) for r in regions] == [(x + 1.0, y + 1.0) for x, y in zip(X_PIX, Y_PIX, strict=True)]
    assert [r.semi_major * SCALE_ARCSEC for r in regions] == pytest.approx([7.5, 7.5, 30.0])
    assert {(r.shape, r.frame, r.colour) for r in regions} == {("circle", "image", "cyan")}
    assert [r.label for r in regions] == ["0", "1", "2"]


@pytest.mark.parametrize(("rotation_deg", "mirrored"), [(0.0, False), (50.0, False), (30.0, True)])
def test_region_ellipses_lie_on_the_sky_as_in_the_image(tmp_path, rotation_deg, mirrored):
    header = sky_header(rotation_deg=rotation_deg, mirrored=mirrored)
    grid = read_counts_image(write_image(tmp_path / "c.fits", header=header)).grid
    frame = detections().assign(a_pix=[5.0, 6.0, np.nan], b_pix=[2.0, 3.0, 1.0], theta_deg=[20.0, 170.0, 0.0])
    write_regions(tmp_path / "a.reg", frame, sample_observation(grid))
    regions = read_regions(tmp_path / "a.reg")
    assert [r.shape for r in regions] == ["ellipse", "ellipse", "circle"]
    for region, (_, row) in zip(regions[:2], frame.iterrows(), strict=False):
        centre = SkyCoord(region.x, region.y, unit="deg")
        tip = centre.directional_offset_by((region.angle_deg - 90.0) * units.deg, region.semi_major * units.arcsec)
        x_tip, y_tip = WCS(header).world_to_pixel(tip)
        theta = np.radians(row["theta_deg"])
        expected = row["x_pix"] + row["a_pix"] * np.cos(theta), row["y_pix"] + row["a_pix"] * np.sin(theta)
        np.testing.assert_allclose([x_tip, y_tip], expected, atol=2e-3)


def test_kron_radius_stretches_the_ellipse_and_bad_shapes_become_circles(tmp_path):
    shapes = {"a_pix": [2.0, 2.0, 2.0], "b_pix": [1.0, 1.0, 1.0], "theta_deg": [0.0, 0.0, np.nan]}
    frame = detections().assign(**shapes, kron_radius=[3.0, 0.0, 3.0])
    write_regions(tmp_path / "a.reg", frame, sample_observation())
    first, *others = read_regions(tmp_path / "a.reg")
    assert (first.shape, first.semi_major, first.semi_minor) == ("ellipse", 6.0, 3.0)
    assert [r.shape for r in others] == ["circle", "circle"]


def test_north_up_image_has_equal_angles_on_the_sky_and_in_pixels(tmp_path):
    frame = detections(1).assign(a_pix=[5.0], b_pix=[2.0], theta_deg=[20.0])
    write_regions(tmp_path / "a.reg", frame, sky_observation(tmp_path))
    assert read_regions(tmp_path / "a.reg")[0].angle_deg == pytest.approx(20.0, abs=0.05)


def test_no_detections_give_a_region_file_without_regions(tmp_path):
    write_regions(tmp_path / "a.reg", detections(0), sky_observation(tmp_path))
    assert read_regions(tmp_path / "a.reg") == []


def test_unknown_colour_lists_the_known_ones(tmp_path):
    with pytest.raises(BadInput, match="must be one of black, white"):
        write_regions(tmp_path / "a.reg", detections(), sample_observation(), colour="mauve\ncircle")


@pytest.mark.parametrize(
    "line", ["box(1,2,3,4,0)", "circle(1,2)", "circle(a,b,c)", "-circle(1,2,3)", "ellipse(1,2,3,4)", "\0"]
)
def test_region_that_is_not_understood_is_named_by_its_line(tmp_path, line):
    (tmp_path / "a.reg").write_text(f"# comment\nimage\n{line}\n")
    with pytest.raises(BadInput, match="line 3"):
        read_regions(tmp_path / "a.reg")


def test_regions_of_other_programs_are_read(tmp_path):
    lines = (
        "global color=red\nimage ; ellipse(238.5,142.5,2.9,2.8,548.9) # color=magenta\nfk5;circle(10.5,-3.25,0.5')\n"
    )
    (tmp_path / "a.reg").write_text(lines)
    first, second = read_regions(tmp_path / "a.reg")
    assert (first.frame, first.x, first.semi_minor, first.angle_deg, first.colour) == (
        "image",
        238.5,
        2.8,
        548.9,
        "magenta",
    )
    assert (second.frame, second.y, second.semi_major, second.colour) == ("fk5", -3.25, 30.0, "red")


@pytest.fixture
def field_file(tmp_path):
    parameters = {"seed": 20010208, "campaign": "déjà", "cell": {"band": "soft"}}
    path = tmp_path / "field.fits"
    write_simulated_field(
        path, sample_field(), pointing_deg=(359.99, -60.0), telescope="XMM", instrument="EPIC", parameters=parameters
    )
    return path


def test_simulated_field_is_read_as_the_same_image(field_file):
    field = sample_field()
    image = read_counts_image(field_file)
    np.testing.assert_array_equal(image.counts, field.observation.counts)
    assert image.grid.scale_arcsec == pytest.approx(SCALE_ARCSEC)
    assert image.grid.axis_pix == pytest.approx(field.observation.grid.axis_pix, abs=1e-6)
    assert (image.facts.exposure_s, image.facts.energy_min_kev, image.facts.telescope) == (1e4, 0.5, "XMM")
    exposure_s = read_exposure_map(field_file, image.grid.shape, image.grid.wcs, "EXPOSURE")
    np.testing.assert_array_equal(exposure_s, field.observation.exposure_s)


def test_simulated_field_holds_its_own_maps(field_file):
    read = observation_from_files(field_file, exposure_path=field_file, background_path=field_file, psf=SamplePsf())
    np.testing.assert_array_equal(read.observation.exposure_s, 1e4)
    np.testing.assert_array_equal(read.observation.background, 0.25)


def test_simulated_field_is_a_sound_fits_file(field_file):
    with fits.open(field_file, checksum=True) as units_read:
        units_read.verify("exception")
        assert [unit.name for unit in units_read] == ["COUNTS", "EXPOSURE", "BACKGROUND", "PHOTONS", "TRUTH"]
        assert all(unit.verify_checksum() == 1 and unit.verify_datasum() == 1 for unit in units_read)
        header = units_read[0].header
        assert (header["BUNIT"], header["E_UNIT"], header["RADESYS"]) == ("count", "keV", "ICRS")
        assert (header["SMC SEED"], header["SMC KEY"]) == (20010208, "5f3c")
        assert json.loads(header["SMCPARAM"])["campaign"] == "déjà"
        assert units_read["EXPOSURE"].header["BUNIT"] == "s"
        np.testing.assert_array_equal(units_read["BACKGROUND"].data, 0.25)
        assert "DATE" not in header


def test_true_sources_are_where_the_wcs_puts_their_pixels_and_east_is_left(field_file):
    truth = Table.read(field_file, hdu="TRUTH")
    x_pix, y_pix = WCS(fits.getheader(field_file)).world_to_pixel(SkyCoord(truth["RA"], truth["DEC"]))
    np.testing.assert_allclose([x_pix, y_pix], [truth["x_pix"], truth["y_pix"]], atol=1e-6)
    offset = SkyCoord(359.99, -60.0, unit="deg").spherical_offsets_to(SkyCoord(truth["RA"], truth["DEC"]))
    np.testing.assert_allclose(offset[0].arcsec, -truth["x_arcsec"], atol=0.01)
    np.testing.assert_allclose(offset[1].arcsec, truth["y_arcsec"], atol=0.01)


def test_photons_of_the_file_fall_into_the_counts_with_their_origin(field_file):
    photons = Table.read(field_file, hdu="PHOTONS")
    counts = np.zeros_like(sample_counts())
    np.add.at(counts, (np.rint(photons["y_pix"]).astype(int), np.rint(photons["x_pix"]).astype(int)), 1)
    np.testing.assert_array_equal(counts, fits.getdata(field_file))
    assert (np.asarray(photons["source_id"]) == 1).sum() == 100


def test_equal_fields_are_equal_bytes(tmp_path):
    for name in ("a.fits", "b.fits"):
        write_simulated_field(tmp_path / name, sample_field())
    assert (tmp_path / "a.fits").read_bytes() == (tmp_path / "b.fits").read_bytes()


def test_field_without_sources_or_photons_is_written(tmp_path):
    empty = sample_field(n_photons=0)
    bare = replace(empty, truth_rows=ArrayFrame.of_frame(empty.truth.iloc[:0]))
    write_simulated_field(tmp_path / "a.fits", bare)
    assert read_counts_image(tmp_path / "a.fits").counts.sum() == 0
    assert len(Table.read(tmp_path / "a.fits", hdu="TRUTH")) == 0
    assert isinstance(bare.truth, pd.DataFrame)


def test_pointing_must_be_on_the_sky(tmp_path):
    with pytest.raises(BadInput, match="right ascension"):
        write_simulated_field(tmp_path / "a.fits", sample_field(), pointing_deg=(10.0, 91.0))
