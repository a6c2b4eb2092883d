"""The page: whole, self-contained, and unmoved by hostile names."""

import re
from html.parser import HTMLParser

import pytest
from fake_run import CELLS, METHODS, FakeRun, stub_writer

from survey_mc.report import build_report
from survey_mc.report.markup import Html, tag
from survey_mc.report.numbers import plain, power, with_interval
from survey_mc.report.tables import build_tables

VOID = {"meta", "img", "br", "hr"}


class Page(HTMLParser):
    """Checks that every element is closed in order; collects elements and attributes."""

    def __init__(self, text):
        super().__init__()
        self.open, self.elements = [], []
        self.feed(text)
        self.close()

    def handle_starttag(self, tag, attrs):
        self.elements.append((tag, dict(attrs)))
        if tag not in VOID:
            self.open.append(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def all(self, name):
        return [attributes for tag, attributes in self.elements if tag == name]


@pytest.fixture(scope="module")
def page(hostile_page):
    return Page(hostile_page)


def test_every_element_is_closed(page):
    assert page.open == []


def test_nothing_is_fetched_from_anywhere(page, hostile_page):
    assert not re.search(r"https?:", hostile_page)
    assert all(image["src"].startswith("data:image/png;base64,") for image in page.all("img"))
    assert not page.all("script") + page.all("link") + page.all("iframe")
    policy = next(m["content"] for m in page.all("meta") if m.get("http-equiv") == "Content-Security-Policy")
    assert policy.startswith("default-src 'none'; img-src data:; style-src 'unsafe-inline'; ")
    assert policy.endswith("base-uri 'none'; form-action 'none'")


def test_hostile_names_stay_text(hostile_page):
    assert "<script" not in hostile_page
    assert "&lt;script&gt;alert(&#x27;x&#x27;)" in hostile_page


def test_every_link_inside_the_page_has_a_target(page):
    targets = {attributes["id"] for _, attributes in page.elements if "id" in attributes}
    inside = [a["href"][1:] for a in page.all("a") if a["href"].startswith("#")]
    assert inside
    assert set(inside) <= targets
    assert len(targets) == sum("id" in attributes for _, attributes in page.elements)


def test_every_image_says_what_it_shows(page):
    assert page.all("img")
    assert all(len(image["alt"]) > 40 for image in page.all("img"))


def test_links_to_tables_point_to_written_files(small_run, tmp_path):
    path = build_report(small_run, tmp_path, write_frame=stub_writer)
    page = Page(path.read_text(encoding="utf-8"))
    links = [a["href"] for a in page.all("a") if not a["href"].startswith("#")]
    assert len(links) > 10
    assert "extended found" not in path.read_text(encoding="utf-8")
    assert all((path.parent / link).resolve().is_file() for link in links)
    assert (path.parent / "false_detections.png").read_bytes().startswith(b"\x89PNG")


def test_point_and_extended_sources_have_figures_and_headline_values_apart(mixed_run, tmp_path):
    text = build_report(mixed_run, tmp_path, write_frame=stub_writer).read_text(encoding="utf-8")
    assert "extended found" in text
    assert re.search(r"<td>\d+ of \d+</td>", text)
    tables = build_tables(mixed_run, tmp_path, stub_writer)
    limits = tables["completeness_limit"].query("level == 0.9 and quantity == 'flux_true_cgs' and rule == 'nearest'")
    by_kind = limits[limits["method"] == "EML"].set_index("kind")["limit"]
    assert power(by_kind["point"])[0] in text
    assert power(by_kind["point"])[0] != power(by_kind["all"])[0]
    assert power(by_kind["all"])[0] not in text
    for kind in ("point", "extended"):
        assert f"Completeness against flux, {kind} sources" in text
    assert "Completeness against flux</h3>" not in text


def test_campaign_file_of_the_run_is_shown(tmp_path):
    class NothingDone(FakeRun):
        def realisations_done(self, table, cell_label, method_label=""):
            return 0

        def journal(self):
            return super().journal().iloc[:0]

    (tmp_path / "campaign.toml").write_text('name = "<deep>"')
    path = build_report(NothingDone(CELLS[:1], METHODS[:1]), tmp_path, write_frame=stub_writer)
    text = path.read_text(encoding="utf-8")
    assert "name = &quot;&lt;deep&gt;&quot;" in text
    assert "EML in xmm_epic-soft-10ks: 0 of 6 fields are done" in text
    assert "<img" not in text


def test_texts_are_escaped_and_markup_is_not():
    assert tag("p", "a < b", Html("<b>c</b>"), title='"x"') == '<p title="&quot;x&quot;">a &lt; b<b>c</b></p>'


@pytest.mark.parametrize(
    ("value", "words"), [(2.333, "2.33"), (0.0, "0"), (105.4, "105"), (0.0512, "0.0512"), (float("nan"), "–")]
)
def test_numbers_have_three_digits(value, words):
    assert plain(value) == words


def test_small_numbers_share_one_power_of_ten_with_their_interval():
    assert power(1.668e-15, 1.585e-15, 1.783e-15) == ("1.67 × 10⁻¹⁵", "1.58 … 1.78")
    assert power(2e-16) == ("2.00 × 10⁻¹⁶", "")


def test_open_interval_says_infinity():
    assert with_interval(2.0, 1.0, float("inf")) == ("2.00", "1.00 … ∞")
