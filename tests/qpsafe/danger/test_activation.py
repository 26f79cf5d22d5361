"""Activations (19), (21), Table I and the regime weights."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from qpsafe.danger.activation import Activation, Threshold, regime_weights
from qpsafe.errors import ConfigurationError

danger = st.floats(0.0, 30.0)


@pytest.mark.parametrize(("delta", "epsilon"), [(11.5, 0.15), (7.5, 0.25), (3.0, 0.9)])
def test_switch_meets_the_points_that_equation_19_fixes(delta: float, epsilon: float) -> None:
    switch = Threshold(delta, epsilon)
    assert switch(delta * (1 - epsilon)) == 1.0
    assert switch(delta) == 0.5
    assert switch(delta * (1 + epsilon)) == 0.0
    assert switch(delta * (1 + epsilon / 2)) == pytest.approx(0.5 - 0.5 * math.sin(math.pi / 4), abs=1e-14)


@given(danger, danger)
def test_switches_never_rise_with_danger(a: float, b: float) -> None:
    low, high = sorted((a, b))
    activation = Activation()
    for at_low, at_high in zip(activation.switches(low), activation.switches(high), strict=True):
        assert at_low >= at_high


@given(danger, st.floats(0.0, 1e-3))
def test_switches_are_continuous(x: float, step: float) -> None:
    # steepest slope of (19) is pi / (4 ε Δ)
    for threshold in Activation().thresholds:
        slope = math.pi / (4 * threshold.epsilon * threshold.delta)
        assert abs(threshold(x + step) - threshold(x)) <= slope * step + 1e-12


@given(danger)
def test_table_1_has_no_impossible_situation(x: float) -> None:
    m, f = Activation().switches(x)
    assert not (m < 1.0 and f > 0.0)  # the high-priority task is only touched once the low one is released


def test_nan_counts_as_full_danger() -> None:
    assert Activation().switches(math.nan) == (0.0, 0.0)
    assert Activation().regime(math.nan) == "high"


@given(st.lists(st.floats(0.0, 1.0), min_size=1, max_size=6))
def test_regime_weights_are_a_convex_combination(switches: list[float]) -> None:
    activations = tuple(np.cumprod(switches))
    weights = regime_weights(activations)
    assert len(weights) == len(switches) + 1
    assert (weights >= 0.0).all()
    assert weights.sum() == pytest.approx(1.0, abs=1e-12)
    # the activation of a task is the total weight of the regimes that keep it
    for k, a in enumerate(activations):
        assert weights[k + 1 :].sum() == pytest.approx(a, abs=1e-12)


@given(st.floats(0.0, 1.0), st.floats(0.0, 1.0))
def test_two_tasks_give_the_weights_of_table_1(m: float, f: float) -> None:
    assert regime_weights((m, m * f)) == pytest.approx([1 - m, m * (1 - f), m * f], abs=1e-15)


@pytest.mark.parametrize(
    ("danger_level", "regime"),
    [(0.0, "low"), (5.6, "low"), (5.7, "medium"), (9.7, "medium"), (9.8, "high"), (99, "high")],
)
def test_regimes_begin_at_the_reduced_thresholds(danger_level: float, regime: str) -> None:
    assert Activation().regime(danger_level) == regime


def test_overlapping_thresholds_are_refused_by_name() -> None:
    with pytest.raises(ConfigurationError, match=r"thresholds\[1\].*Δ\(1\+ε\) <= 9\.775"):
        Activation((Threshold(11.5, 0.15), Threshold(9.0, 0.25)))


@pytest.mark.parametrize(("delta", "epsilon"), [(0.0, 0.1), (math.nan, 0.1), (math.inf, 0.1), (1.0, 0.0), (1.0, 1.0)])
def test_wrong_threshold_values_are_refused(delta: float, epsilon: float) -> None:
    with pytest.raises(ConfigurationError):
        Threshold(delta, epsilon)


def test_equal_neighbours_are_released_together() -> None:
    """Two tools: positions kept at m, orientations at m f, and the same three regimes as one tool has."""
    from qpsafe.danger.activation import Activation, Threshold, regime_weights

    one, two = Activation(), Activation((Threshold(11.5, 0.15),) * 2 + (Threshold(7.5, 0.25),) * 2)
    for danger in [*np.linspace(0.0, 20.0, 201), float("nan"), float("inf")]:
        m, mf = one.activations(danger)
        assert two.activations(danger) == (m, m, mf, mf)
        assert two.switches(danger) == one.switches(danger)
        assert two.regime(danger) == one.regime(danger)
        assert two.kept(danger) == 2 * one.kept(danger)
        high, nothing, medium, nothing_either, low = regime_weights(two.activations(danger))
        assert nothing == nothing_either == 0.0
        np.testing.assert_array_equal((high, medium, low), regime_weights((m, mf)))
    assert two.suspend_above == one.suspend_above


def test_tasks_apart_by_another_one_are_not_neighbours() -> None:
    from qpsafe.danger.activation import Activation, Threshold

    with pytest.raises(ConfigurationError, match=r"thresholds\[2\]"):
        Activation((Threshold(11.5, 0.15), Threshold(7.5, 0.25), Threshold(11.5, 0.15)))


factors = st.floats(0.01, 100.0)


@given(danger, factors, st.integers(1, 3), st.integers(1, 3))
def test_thresholds_and_danger_may_be_scaled_together(x: float, factor: float, high: int, low: int) -> None:
    own = Activation((Threshold(11.5, 0.15),) * high + (Threshold(7.5, 0.25),) * low)
    scaled = own.scaled(factor, factor)
    assert scaled.counts == own.counts
    assert scaled.activations(factor * x) == pytest.approx(own.activations(x), abs=1e-9)


@given(danger, st.floats(1.0, 100.0), st.floats(1.0, 100.0))
def test_higher_thresholds_release_less(x: float, high: float, low: float) -> None:
    own = Activation()
    high = max(high, low)  # Table I's condition stays met
    for more, less in zip(own.scaled(high, low).activations(x), own.activations(x), strict=True):
        assert more >= less


@pytest.mark.parametrize(
    "given_factors", [(), (2.0,), (2.0, 2.0, 2.0), (0.0, 1.0), (-1.0, 1.0), (math.nan, 1.0), ("2", 1.0), (1.0, 2.0)]
)
def test_factors_that_make_no_activation_are_refused(given_factors: tuple[float, ...]) -> None:
    with pytest.raises(ConfigurationError):
        Activation().scaled(*given_factors)


def test_what_a_class_of_ones_own_switches_is_not_scaled_in_silence() -> None:
    class Own(Activation):
        pass

    with pytest.raises(ConfigurationError, match="Own"):
        Own().scaled(2.0, 2.0)


def test_levels_do_not_become_one_in_silence() -> None:
    with pytest.raises(ConfigurationError, match="apart"):
        Activation((Threshold(10.0, 0.2), Threshold(5.0, 0.2))).scaled(1.0, 2.0)
