import pytest
from pydantic import ValidationError

from survey_mc.match import MatchParams


def test_one_limit_serves_every_exposure():
    assert MatchParams(counts_min=15).limit(37.0) == 15.0


def test_limits_are_looked_up_by_the_value_of_the_exposure():
    params = MatchParams(counts_min={"10": 10, "1e2": 30})
    assert (params.limit(10.0), params.limit(100.0)) == (10.0, 30.0)


def test_missing_limit_names_the_exposure_and_the_known_ones():
    with pytest.raises(ValueError, match=r"no limit for 50 ks \(given for: 10, 100\)"):
        MatchParams(counts_min={"100": 30, "10": 10}).limit(50.0)


@pytest.mark.parametrize("key", ["ten", "-1", "0", "inf", "nan"])
def test_limit_for_a_thing_that_is_no_exposure_is_refused(key):
    with pytest.raises(ValidationError, match="keys are exposures"):
        MatchParams(counts_min={key: 10})


def test_link_radius_below_the_search_radius_is_refused():
    with pytest.raises(ValidationError, match="link_radius_arcsec must be at least radius_arcsec = 20"):
        MatchParams(radius_arcsec=20, link_radius_arcsec=10)


def test_aperture_cap_below_the_aperture_is_refused():
    with pytest.raises(ValidationError, match="aperture_max_arcsec must be at least"):
        MatchParams(origin_radius_arcsec=200)


def test_realised_counts_cannot_select_sources():
    with pytest.raises(ValidationError):
        MatchParams(counts_min_on="counts_drawn")


def test_every_parameter_is_described():
    assert all(f.description for f in MatchParams.model_fields.values())
