import math

import numpy as np
import pytest

from survey_mc.paper.claims import parse_value
from survey_mc.paper.statistics.statistic import within
from survey_mc.paper.verdict import LEAST_VALUES, TAIL, distance, judge, judge_constant, spread_of

N_TRIALS = 4000
# two-sided chance 1e-4 that a binomial of 4000 trials is further from its mean
Z_1E4 = 3.9


def differing(n_values: int, draw, as_published) -> int:
    rng = np.random.default_rng(20010208)
    return sum(judge(as_published(draw(rng, 1)[0]), draw(rng, n_values)).verdict == "differs" for _ in range(N_TRIALS))


@pytest.mark.parametrize("n_values", [LEAST_VALUES, 200])
def test_a_true_model_differs_in_five_percent_of_the_rows(n_values):
    def number(x):
        return within("", x, x)

    chance = 2 * math.floor(TAIL * (n_values + 1)) / (n_values + 1)
    n = differing(n_values, lambda rng, k: rng.normal(size=k), number)
    assert abs(n - chance * N_TRIALS) < Z_1E4 * math.sqrt(N_TRIALS * chance * (1 - chance))


def test_a_true_model_of_whole_numbers_differs_less_often():
    n = differing(200, lambda rng, k: rng.poisson(4.0, k).astype(float), lambda x: parse_value(f"{x:.0f}", "sources"))
    assert 0 < n < 0.05 * N_TRIALS


def test_the_verdict_needs_39_values_to_be_able_to_fail():
    far = parse_value("1000", "sources")
    assert judge(far, np.zeros(LEAST_VALUES - 1)).verdict == "not comparable"
    assert "39" in judge(far, np.zeros(LEAST_VALUES - 1)).reason
    assert judge(far, np.zeros(LEAST_VALUES)).verdict == "differs"


def test_many_groups_of_few_fields_are_few_values():
    groups = np.zeros(500)
    few, enough = (judge(parse_value("1000", "sources"), groups, n) for n in (LEAST_VALUES - 1, LEAST_VALUES))
    assert (few.verdict, enough.verdict) == ("not comparable", "differs")
    assert "38 fields" in few.reason
    assert "39 fields" in enough.reason


def test_values_that_an_image_does_not_give_are_left_out():
    values = np.append(np.arange(50.0), np.full(100, np.nan))
    judged = judge(parse_value("25", "sources"), values)
    assert (judged.spread.n, judged.verdict) == (50, "reproduced")
    assert judged.percentile == pytest.approx(51.0)


def test_the_printed_rounding_is_allowed_for():
    ours = np.full(100, 0.0714)
    assert judge(parse_value("0.071"), ours).verdict == "reproduced"
    assert judge(parse_value("0.072"), ours).verdict == "differs"


def test_a_bound_is_reproduced_by_values_on_its_side():
    ours = np.linspace(0.0, 10.0, 101)
    assert judge(parse_value(">9"), ours).verdict == "reproduced"
    assert judge(parse_value("<6"), ours).verdict == "reproduced"
    assert judge(parse_value(">20"), ours).verdict == "differs"


def test_a_word_without_a_meaning_is_not_comparable():
    assert judge(parse_value("numerous"), np.zeros(100)).verdict == "not comparable"


def test_no_value_at_all_is_not_comparable():
    judged = judge(parse_value("3", "sources"), np.full(50, np.nan))
    assert judged.verdict == "not comparable"
    assert math.isnan(judged.spread.median)


def test_infinite_values_are_values():
    spread = spread_of(np.array([1.0, 2.0, math.inf, math.inf, math.inf]))
    assert (spread.n, spread.median, spread.lower_68) == (5, math.inf, pytest.approx(2.0, abs=0.7))


def test_a_constant_must_lie_within_the_printed_digits():
    assert judge_constant(parse_value("90", "counts"), 89.55).verdict == "reproduced"
    assert judge_constant(parse_value("0.53"), 0.535).verdict == "reproduced"
    assert judge_constant(parse_value("0.53"), 0.536).verdict == "differs"


def test_the_distance_is_zero_inside_what_is_printed():
    value = parse_value("0.25-0.30")
    assert distance(value, 0.28) == 0.0
    assert distance(value, 0.205) == pytest.approx(0.04)
    assert distance(value, 0.405) == pytest.approx(0.1)
    assert math.isnan(distance(value, math.nan))
