"""The compiled loops of matching against the same written plainly."""

import numpy as np
import pytest

from survey_mc.match import links, origin

N_CASES = 60


def random_shares(rng):
    """Columns (detection, source, photons, photons around) as the aperture count gives them, with many ties, and their
    separations, some NaN."""
    rows = []
    for detection in range(rng.integers(0, 8)):
        for source in rng.permutation(9)[: rng.integers(0, 6)]:
            rows.append((detection, source, rng.integers(1, 5), rng.integers(0, 4)))
    shares = np.ascontiguousarray(np.array(rows, dtype=np.int64).reshape(-1, 4).T)
    n = shares.shape[1]
    return shares, np.where(rng.random(n) < 0.2, np.nan, rng.integers(0, 3, n).astype(float))


def plain_strongest(shares, separation, detection):
    """Places of the main and the second share of a detection, by sorting."""
    distance = np.where(np.isnan(separation), np.inf, separation)
    whose, source, inside, around = shares
    mine = np.flatnonzero(whose == detection)
    by_photons = sorted(mine, key=lambda k: (-inside[k], distance[k], source[k]))
    by_excess = sorted(by_photons, key=lambda k: around[k] - inside[k])
    if not by_photons:
        return -1, -1
    best = by_excess[0]
    stands_out = inside[best] - around[best] > 2.0 * np.sqrt(inside[best] + around[best])
    main = best if stands_out else by_photons[0]
    return main, next((k for k in by_photons if k != main), -1)


@pytest.mark.parametrize("seed", range(N_CASES))
def test_strongest_shares_are_the_first_when_sorted(seed):
    shares, separation = random_shares(np.random.default_rng(seed))
    main, second = origin._strongest(*shares, separation, 9)
    assert [plain_strongest(shares, separation, d) for d in range(9)] == list(zip(main, second, strict=True))


@pytest.mark.parametrize("seed", range(N_CASES))
def test_linked_pairs_are_the_close_ones_and_those_that_share_enough(seed):
    rng = np.random.default_rng(seed)
    shares, _ = random_shares(rng)
    close = np.array(sorted({(rng.integers(0, 8), rng.integers(0, 9)) for _ in range(rng.integers(0, 12))}))
    close = close.reshape(-1, 2).astype(np.int64)
    photons = {(d, s): n for d, s, n, _ in shares.T.tolist()}
    wanted = {pair: photons.get(pair, 0) for pair in map(tuple, close.tolist())}
    wanted |= {pair: n for pair, n in photons.items() if n >= 3}

    found = np.empty((3, len(close) + shares.shape[1]), dtype=np.int64)
    n_found = links._put_linked(*np.ascontiguousarray(close.T), *shares[:3], 3, found)
    assert n_found == len(wanted)
    assert {(d, s): n for d, s, n in zip(*found[:, :n_found], strict=True)} == wanted


@pytest.mark.parametrize("n_detections", [0, 1, 40])
def test_candidates_are_all_pairs_within_reach_and_no_others(n_detections):
    rng = np.random.default_rng(n_detections)
    x_detection, x_source = rng.uniform(-0.5, 63.5, n_detections), rng.uniform(-20.0, 84.0, 300)
    y_detection, y_source = np.sort(rng.uniform(-0.5, 63.5, n_detections)), rng.uniform(-20.0, 84.0, 300)
    has_place = rng.random(300) < 0.9
    for values in (x_source, y_source, has_place):
        values.setflags(write=False)
    found = links._candidates(x_detection, y_detection, x_source, y_source, has_place, 7.5)
    distance = np.hypot(np.subtract.outer(x_detection, x_source), np.subtract.outer(y_detection, y_source))
    wanted = np.nonzero((distance <= 7.5) & has_place)
    assert sorted(zip(*found, strict=True)) == sorted(zip(*wanted, strict=True))
