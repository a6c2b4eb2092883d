import math

import pytest

from survey_mc.errors import BadInput
from survey_mc.paper.claims import half_width, load_claims, parse_value
from survey_mc.paper.statistics import evidence_by_claim


def test_there_are_187_facts_with_different_names():
    claims = load_claims()
    assert len(claims) == 187
    assert len({claim.id for claim in claims}) == 187


def test_every_fact_has_evidence_and_no_evidence_is_without_a_fact():
    assert set(evidence_by_claim()) == {claim.id for claim in load_claims()}


def test_every_fact_that_is_no_word_allows_an_interval_around_its_number():
    for claim in load_claims():
        value = claim.published
        if value.kind != "word":
            assert value.lower <= value.number <= value.upper, claim.id


def test_the_words_are_those_that_a_statistic_gives_a_meaning():
    words = {claim.id for claim in load_claims() if claim.published.kind == "word"}
    assert words == {name for name, e in evidence_by_claim().items() if getattr(e, "meaning", None) is not None}
    assert {c.published.text for c in load_claims() if c.id in words} == {
        "not detected",
        "significant",
        "marginal",
        "absent",
    }


@pytest.mark.parametrize(
    ("text", "unit", "expected"),
    [
        ("0.071", "", 0.0005),
        ("6.0", "arcsec", 0.05),
        ("4", "sources", 0.0),
        ("370", "detections", 0.0),
        ("90", "counts", 5.0),
        ("2", "times", 0.5),
        ("2e-15", "erg/cm2/s", 0.5e-15),
        ("1.78e-05", "ct/s/pixel", 0.005e-5),
    ],
)
def test_a_number_is_known_to_half_of_its_last_printed_digit(text, unit, expected):
    assert half_width(text, unit) == pytest.approx(expected, rel=1e-12)


def test_a_range_reaches_half_a_digit_beyond_its_ends():
    value = parse_value("0.25-0.30")
    assert (value.kind, value.number) == ("range", pytest.approx(0.275))
    assert (value.lower, value.upper) == (pytest.approx(0.245), pytest.approx(0.305))


def test_a_bound_is_open_on_one_side():
    assert (parse_value("<6").lower, parse_value("<6").upper) == (-math.inf, 6.0)
    assert (parse_value(">0.98").lower, parse_value(">0.98").upper) == (0.98, math.inf)


def test_a_fraction_keeps_its_denominator_and_is_exact():
    value = parse_value("15 of 1287")
    assert (value.number, value.of, value.lower, value.upper) == (15.0, 1287.0, 15.0, 15.0)


def test_a_missing_value_is_refused():
    with pytest.raises(BadInput, match="missing"):
        parse_value(" ")


def test_below_a_printed_power_of_ten_the_next_number_is_a_tenth_of_a_digit_away():
    value = parse_value("1e-14")
    assert value.lower == pytest.approx(0.95e-14)
    assert value.upper == pytest.approx(1.5e-14)
    assert parse_value("2e-15").lower == pytest.approx(1.5e-15)
