"""Figures: the same look for a method everywhere, pictures of a field, nothing from nothing."""

from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
from fake_run import METHODS, FakeMethod

from survey_mc.columns import DETECTIONS, MATCHES, TRUTH
from survey_mc.report import FieldPicture
from survey_mc.report.figures import field_figures, looks
from survey_mc.report.figures.measures import cost_figure
from survey_mc.report.figures.style import COLOUR_OF
from survey_mc.types import Band, Observation, PixelGrid

PNG = b"\x89PNG\r\n"


def test_colour_of_a_method_does_not_depend_on_the_others():
    assert looks(METHODS)["WAV"].colour == looks(METHODS[3:4])["WAV"].colour == COLOUR_OF["wavdetect"]


def test_known_procedures_have_different_colours():
    assert len(set(COLOUR_OF.values())) == len(COLOUR_OF)


def test_two_labels_of_one_procedure_share_its_colour_and_differ_in_line():
    first, second = looks([FakeMethod("mr1_se", "a"), FakeMethod("mr1_se", "b")]).values()
    assert first.colour == second.colour
    assert (first.line, first.marker) != (second.line, second.marker)


def test_costs_of_labels_that_the_campaign_no_longer_has_make_no_panel():
    costs = pd.DataFrame(
        {"cell": "c", "stage": "detect", "method": ["old", "WAV"], "cpu_s_per_field": [1.0, 2.0], "fields": 4}
    )
    cells = [SimpleNamespace(label="c", band="soft", exposure_ks=10.0, instrument="xmm_epic")]
    look = looks(METHODS)

    assert cost_figure(costs[costs["method"] == "old"], cells, look) is None
    assert cost_figure(costs, cells, look).png.startswith(PNG)


def frame(table, n, **values):
    return pd.DataFrame({c: np.broadcast_to(values.get(c, 0), n) for c in table.names})


@pytest.fixture
def picture():
    counts = np.random.default_rng(1).poisson(0.2, (60, 60)).astype(np.int32)
    observation = Observation(counts, None, np.ones((60, 60)), None, None, PixelGrid.centred(60, 4.0),
                              Band("soft", 0.5, 2.0))  # fmt: skip
    status = ["matched", "duplicate", "faint", "blend", "spurious", "outside", "missed"]
    matches = frame(
        MATCHES, 7, rule="nearest", status=status, det_id=[0, 1, 2, 3, 4, 5, -1], source_id=[0, 0, 1, 1, -1, -1, 1]
    )
    places = {"x_pix": np.linspace(10, 50, 6), "y_pix": np.linspace(15, 45, 6)}
    detections = frame(DETECTIONS, 6, det_id=np.arange(6), **places)
    truth = frame(TRUTH, 2, source_id=[0, 1], x_pix=[10.0, 30.0], y_pix=[15.0, 30.0])
    label = "<b>$x"
    return FieldPicture("soft, 10 ks", observation, truth, {label: detections}, {label: matches},
                        {label: counts * 0.5}, region_arcmin=1.5)  # fmt: skip


def test_field_is_shown_raw_filtered_and_annotated(picture):
    figures = field_figures(picture)
    assert [f.name for f in figures] == ["field_images", "field_outcomes"]
    assert all(f.png.startswith(PNG) for f in figures)


def test_same_field_gives_the_same_bytes(picture):
    assert field_figures(picture)[1].png == field_figures(picture)[1].png


def test_dark_image_is_drawn(picture):
    from dataclasses import replace

    dark = replace(picture.observation, counts=np.zeros((60, 60), dtype=np.int32))
    assert field_figures(replace(picture, observation=dark, views={}, matches={}))[0].png.startswith(PNG)
