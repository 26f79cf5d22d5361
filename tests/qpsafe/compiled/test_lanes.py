"""Lanes: every operation does to each lane what it does to a single number, bit for bit; and in plain Python, too."""

from __future__ import annotations

import math

import numba
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from qpsafe.compiled.elementary import atan2, log, log1p
from qpsafe.compiled.gather import gather, lane, spread
from qpsafe.compiled.lanes import LANES, anywhere, copysign, not_, split, sqrt, where

_any_number = st.floats(width=64)
_many = st.lists(_any_number, min_size=LANES, max_size=LANES)


def _arithmetic(a, b):
    c = 1.0 * a
    c += b
    c -= 2 * a
    return -(abs(a) * b + 3.0 / b) - c


def _choice(a, b):
    found = (a < b) & not_(b <= 0.0) | (a == b)
    other = (a > b) | (b != b) | (a >= 1e300)
    return where(found, a, where(other, copysign(b, a), 2.0))


def _roots(a, b):
    return sqrt(a) + copysign(1.0, b)


def _parts(a, b):
    m, e, scale = split(abs(a))
    return where(m > 1.5, e, where(m > 1.25, scale, m))


def _logarithms(a, b):
    return log(a) + log1p(abs(b))


def _angle(a, b):
    return atan2(a, b)


def _rarely(a, b):
    chosen = a
    if anywhere(a > b):
        chosen = where(a > b, b, a)
    return chosen


def _both(function):
    """The function on two columns of rows: lane by lane, and number by number."""
    compiled = numba.njit(function, error_model="numpy")

    @numba.njit
    def side_by_side(rows, out):
        for first in range(0, rows.shape[0], LANES):
            found = compiled(gather(rows, first, 0), gather(rows, first, 1))
            for k in range(min(LANES, rows.shape[0] - first)):
                out[first + k] = lane(found, k)

    @numba.njit
    def one_by_one(rows, out):
        for k in range(rows.shape[0]):
            out[k] = compiled(rows[k, 0], rows[k, 1])

    return side_by_side, one_by_one


_FUNCTIONS = [_arithmetic, _choice, _roots, _parts, _logarithms, _angle, _rarely]
_COMPILED = {function.__name__: _both(function) for function in _FUNCTIONS}


@pytest.mark.parametrize("name", list(_COMPILED))
@given(data=st.data(), count=st.integers(1, 2 * LANES + 1), layout=st.sampled_from("CFS"))
def test_lanes_do_what_single_numbers_do(name, data, count, layout):
    numbers = data.draw(st.lists(_any_number, min_size=2 * count, max_size=2 * count))
    rows = np.array(numbers).reshape(count, 2)
    given_rows = np.repeat(rows, 3, axis=0)[::3] if layout == "S" else np.array(rows, order=layout)
    out, expected = np.empty(count), np.empty(count)
    side_by_side, one_by_one = _COMPILED[name]
    side_by_side(given_rows, out)
    one_by_one(given_rows, expected)
    np.testing.assert_array_equal(out, expected)
    assert (np.signbit(out) == np.signbit(expected))[~np.isnan(out)].all()


@pytest.mark.parametrize("function", [_arithmetic, _choice, _roots], ids=lambda f: f.__name__)
@given(a=_many, b=_many)
def test_plain_python_does_the_same(function, a, b):
    out, rows = np.empty(LANES), np.column_stack((a, b))
    _COMPILED[function.__name__][0](rows, out)
    with np.errstate(all="ignore"):
        np.testing.assert_array_equal(out, function(*rows.T.copy()))


@numba.njit
def _asked(rows, value):
    flags = gather(rows, 0, 0) > spread(value)
    return anywhere(flags), anywhere(not_(flags))


@given(numbers=_many, value=_any_number)
def test_anywhere_is_any(numbers, value):
    flags = np.array(numbers) > value
    assert _asked(np.array(numbers).reshape(-1, 1), value) == (flags.any(), not flags.all())


@numba.njit
def _elementary(x, y, out):
    for k in range(len(x)):
        out[0, k], out[1, k], out[2, k] = log(x[k]), log1p(x[k]), atan2(y[k], x[k])


def _last_places(found, exact):
    """How many units of the last place numbers are off."""
    return max((abs(f - e) / math.ulp(e) for f, e in zip(found, exact, strict=True)), default=0.0)


@given(
    x=st.lists(st.floats(5e-324, 1.7e308), min_size=1, max_size=20),
    near=st.lists(st.floats(-0.5, 0.5), min_size=1, max_size=20),
    turn=st.floats(-math.pi, math.pi),
)
def test_elementary_functions_are_right_to_three_units_of_the_last_place(x, near, turn):
    x = np.array([*x, *(1.0 + v for v in near)])
    with np.errstate(over="ignore"):
        y = x * math.tan(turn)
    out = np.empty((3, len(x)))
    _elementary(x, y, out)
    assert _last_places(out[0], list(map(math.log, x))) <= 3.0
    assert _last_places(out[1], list(map(math.log1p, x))) <= 3.0
    good = (np.abs(y) < np.inf) & (np.abs(y) > 1e-300) & (x > 1e-300)
    assert _last_places(out[2][good], list(map(math.atan2, y[good], x[good]))) <= 3.0
    _elementary(-x, y, out)
    assert np.isnan(out[0]).all()
    assert _last_places(out[2][good], list(map(math.atan2, y[good], -x[good]))) <= 3.0


def test_elementary_functions_of_what_is_no_usual_number():
    x, out = np.array([0.0, np.inf, np.nan, 1e-310]), np.empty((3, 4))
    _elementary(x, np.zeros(4), out)
    np.testing.assert_array_equal(out[0][:3], [-np.inf, np.inf, np.nan])
    np.testing.assert_array_equal(out[1], [0.0, np.inf, np.nan, 1e-310])
    np.testing.assert_array_equal(out[2][[0, 2, 3]], [0.0, np.nan, 0.0])
