"""Laws of thresholds: intervals hold the truth as often as they say, and are those of any scale alike."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from scipy.optimize import minimize
from toy_ladders import LEVELS, LINE, STICKS, curve

from mpgrasp.exceptions import ConfigError
from mpgrasp.thresholds import Fit, Scale


def at(rate: float, middle: float, width: float, lapse: float = 0.0) -> float:
    """The true threshold of such a curve."""
    share = rate / (1 - lapse)
    return float(middle * np.exp(np.log(share / (1 - share)) * width / (2 * np.log(9))))


def drawn(rate: Callable[[float], float], n: int, rng: np.random.Generator) -> dict[float, tuple[int, int]]:
    return {level: (int(rng.binomial(n, rate(level))), n) for level in LEVELS}


@pytest.mark.parametrize("lapse", [0.0, 0.03])
def test_a_threshold_is_found_to_within_what_many_episodes_allow(lapse: float) -> None:
    fit = Fit(STICKS, drawn(curve(1.3, 0.8, lapse), 1000, np.random.default_rng(0)))
    for rate in (0.5, 0.9):
        assert fit.threshold(rate).level == pytest.approx(at(rate, 1.3, 0.8, lapse), rel=0.05)


def test_a_threshold_is_that_of_greatest_likelihood_where_the_data_are_many() -> None:
    counts = drawn(curve(1.7, 1.0), 3000, np.random.default_rng(1))
    x = np.log(LEVELS)
    k, n = np.array([*counts.values()], float).T

    def loss(parameters: np.ndarray) -> float:
        middle, width = parameters
        p = np.clip(1 / (1 + np.exp(-2 * np.log(9) / width * (x - middle))), 1e-12, 1 - 1e-12)
        return -float(np.sum(k * np.log(p) + (n - k) * np.log1p(-p)))

    middle, _ = minimize(loss, [0.5, 1.0], method="Nelder-Mead").x
    assert Fit(STICKS, counts).threshold(0.5).level == pytest.approx(float(np.exp(middle)), rel=0.02)


def test_intervals_hold_the_truth_as_often_as_they_say() -> None:
    rng, hits, trials = np.random.default_rng(2), 0, 0
    for _ in range(150):
        middle, width = rng.uniform(0.9, 3.0), rng.uniform(0.4, 1.5)
        fit = Fit(STICKS, drawn(curve(middle, width, 0.01), 30, rng))
        for rate in (0.5, 0.9):
            found = fit.threshold(rate)
            hits += found.low <= at(rate, middle, width, 0.01) <= found.high
            trials += 1
    assert 0.92 <= hits / trials <= 0.985


def test_the_unit_of_a_level_changes_nothing_but_the_unit() -> None:
    counts = drawn(curve(1.3, 0.8), 20, np.random.default_rng(3))
    metres = Scale(levels=tuple(x / 1000 for x in LEVELS), logarithmic=True, harder="lower")
    a = Fit(STICKS, counts).threshold(0.9)
    b = Fit(metres, {x / 1000: c for x, c in counts.items()}).threshold(0.9)
    assert np.allclose(np.array(a) / 1000, b, rtol=1e-9)


def test_a_scale_that_gets_harder_upwards_is_the_mirror_of_one_that_gets_harder_downwards() -> None:
    rng = np.random.default_rng(4)
    counts = {x: (int(rng.binomial(30, 1 / (1 + np.exp(2 * (x - 2.5))))), 30) for x in LINE.levels}
    mirror = Scale(levels=tuple(-x for x in reversed(LINE.levels)), harder="lower")
    up = Fit(LINE, counts).threshold(0.9)
    down = Fit(mirror, {-x: c for x, c in counts.items()}).threshold(0.9)
    assert np.allclose([up.level, up.low, up.high], [-down.level, -down.high, -down.low], atol=1e-6)
    assert up.low < up.level < up.high


@pytest.mark.parametrize(("k", "side"), [(20, "harder"), (0, "easier")])
def test_a_threshold_that_is_not_on_the_ladder_lies_beyond_its_end(k: int, side: str) -> None:
    found = Fit(STICKS, {level: (k, 20) for level in LEVELS}).threshold(0.5)
    assert found.level < LEVELS[0] if side == "harder" else found.level > LEVELS[-1]


def test_rates_fall_with_the_difficulty_and_lie_within_their_bounds() -> None:
    fit = Fit(STICKS, drawn(curve(1.3, 0.8), 20, np.random.default_rng(5)))
    levels = np.geomspace(0.5, 5.6, 40)
    rate, low, high = fit.rates(levels)
    assert (np.diff(rate) >= -1e-12).all()
    assert ((low <= rate + 1e-9) & (rate <= high + 1e-9)).all()
    assert ((low >= 0) & (high <= 1)).all()


def test_most_is_told_by_levels_where_nobody_knows_what_will_happen() -> None:
    sure = {0.5: (0, 40), 0.7: (0, 40), 2.8: (40, 40), 4.0: (40, 40), 5.6: (40, 40)}
    assert Fit(STICKS, sure).best_level((0.5, 0.9), 8) in (1.0, 1.4, 2.0)


@pytest.mark.parametrize("harder", ["higher", "lower"])
@pytest.mark.parametrize("logarithmic", [False, True])
def test_the_best_level_is_one_of_those_given_bit_for_bit(harder: str, logarithmic: bool) -> None:
    levels = (0.1, 0.13, 0.3, 0.7, 1.2, 3.3, 7.7)  # of which exp(log(x)) is not always x
    scale = Scale(levels=levels, logarithmic=logarithmic, harder=harder)
    for k in range(len(levels)):
        hard = {x: (0, 9) if (x > levels[k]) == (harder == "higher") else (9, 9) for x in levels}
        assert Fit(scale, hard).best_level((0.5, 0.9), 4) in levels
    assert np.all(np.diff(scale.ease(scale.by_ease)) > 0)


@pytest.mark.parametrize(
    ("make", "said"),
    [
        (lambda: Scale(levels=(1.0, 2.0)), "unusable levels"),
        (lambda: Scale(levels=(1.0, 3.0, 2.0)), "unusable levels"),
        (lambda: Scale(levels=(1.0, float("nan"), 2.0)), "unusable levels"),
        (lambda: Scale(levels=(0.0, 1.0, 2.0), logarithmic=True), "logarithm of a level"),
        (lambda: Scale(levels=(0.0, 1.0, 2.0), harder="more"), "unknown direction"),
        (lambda: Fit(STICKS, {3.0: (1, 2)}), "unknown level"),
        (lambda: Fit(STICKS, {1.0: (3, 2)}), "impossible counts"),
    ],
)
def test_what_is_no_scale_or_no_count_is_refused(make: Callable[[], object], said: str) -> None:
    with pytest.raises(ConfigError, match=said):
        make()
