"""A curve is one that a sensor can have, and a calibration file's that is none is named with file, line and spot."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from amounts import some
from hypothesis import given, settings
from hypothesis import strategies as st

import qpsafe
from qpsafe.sensing.sharp import DEAD_VOLTAGE, SUPPLY, SharpCurve
from qpsafe.sensing.skin.calibration import fit_curve, read_calibration

D = np.linspace(0.2, 0.8, 61)
numbers = st.floats(-2.0, 2.0) | st.floats(-30.0, 30.0) | st.floats(-1e308, 1e308)


@given(numbers, numbers, numbers)
def test_a_curve_falls_strictly_and_gives_its_distances_back_or_is_refused(
    gain: float, offset: float, bias: float
) -> None:
    try:
        curve = SharpCurve(gain, offset, bias)
    except qpsafe.ConfigurationError:
        return
    volts = curve.voltage(D)
    assert (np.diff(volts) < 0.0).all()
    assert curve.distance(volts) == pytest.approx(D, abs=1e-3)
    possible = np.linspace(DEAD_VOLTAGE, SUPPLY, 5001)
    assert np.isfinite(curve.distance(possible)).any()  # some reading is a distance
    assert volts[0] > DEAD_VOLTAGE  # a sensor that works is not taken for a dead one at every distance


BAD: dict[str, list[Any]] = {
    "gain": [0.0, -0.7, 1e-9, 1e308, 100.0],
    "offset": [-0.2, -1.0, 1e6, 1e308],
    "bias": [12.0, 4.9, -12.0, 1e308, -1e308],
}


@pytest.mark.parametrize(("key", "value"), [(key, value) for key, values in BAD.items() for value in values])
def test_a_curve_without_a_distance_for_any_reading_is_refused(key: str, value: float) -> None:
    with pytest.raises(qpsafe.ConfigurationError, match="SharpCurve") as refused:
        SharpCurve(**{key: value})
    assert key in refused.value.key


@pytest.mark.parametrize("key", ["gain", "offset", "bias"])
@pytest.mark.parametrize("value", [True, "0.7", None, np.nan, np.inf, -np.inf, 10**400, -(10**400)])
def test_what_is_no_finite_number_is_refused(key: str, value: Any) -> None:
    with pytest.raises(qpsafe.ConfigurationError) as refused:
        SharpCurve(**{key: value})
    assert refused.value.key == key


@pytest.mark.parametrize(
    ("key", "word"),
    [(key, f"{value}") for key, values in BAD.items() for value in values]
    + [(key, word) for key in BAD for word in ("nan", "inf", "-inf", "true", '"0.7"')],
)
@pytest.mark.parametrize("spot", ["a", "b"])
def test_a_files_curve_that_is_none_is_named(spot: str, key: str, word: str, tmp_path: Path) -> None:
    path = tmp_path / "calibration.toml"
    curves = {name: {"gain": "0.7", "offset": "0.08", "bias": "0.0"} for name in ("a", "b")}
    curves[spot][key] = word
    lines = ['sensor = "S"']
    for name, curve in curves.items():
        lines += ["[[curve]]", f'spot = "{name}"', *(f"{k} = {value}" for k, value in curve.items())]
    path.write_text("\n".join(lines))
    with pytest.raises(qpsafe.RobotFileError) as refused:
        read_calibration(path)
    error, k = refused.value, "ab".index(spot)
    head, line = lines.index(f'spot = "{spot}"'), lines.index(f"{key} = {word}") + 1
    if error.key == f"curve[{k}].{key}":
        assert error.where == f"{path}:{line}"
    else:  # the whole curve
        assert (error.key, error.where) == (f"curve[{k}]", f"{path}:{head}")
        assert word in ("1e-09", "1e+308", "100.0", "1000000.0", "12.0", "4.9", "-12.0", "-1e+308")
    if word not in ("true", '"0.7"'):
        assert error.expected.endswith(f"of spot {spot!r}")


def test_two_curves_of_a_spot_and_a_key_that_is_missing_are_named_with_their_lines(tmp_path: Path) -> None:
    path = tmp_path / "calibration.toml"
    one = '[[curve]]\nspot = "a"\ngain = 0.7\noffset = 0.08\nbias = 0.0\n'
    path.write_text(f'sensor = "S"\n{one}{one}')
    with pytest.raises(qpsafe.RobotFileError, match=r"calibration\.toml:8: curve\[1\]\.spot = 'a'"):
        read_calibration(path)
    path.write_text(f'sensor = "S"\n{one}'.replace("bias = 0.0\n", ""))
    with pytest.raises(qpsafe.RobotFileError, match=r"calibration\.toml:2: curve\[0\]\.bias = 'nothing'"):
        read_calibration(path)
    with pytest.raises(qpsafe.RobotFileError, match="none"):
        read_calibration(tmp_path / "none.toml")


@settings(deadline=None, max_examples=some(5, of=40))
@given(st.floats(-0.2, 5.0), st.floats(0.0, 5.0))
def test_pairs_that_no_sensor_gives_are_named_as_pairs(rise: float, level: float) -> None:
    with pytest.raises(qpsafe.ConfigurationError, match="calibration of a: pairs"):
        fit_curve("a", D, level + max(rise, 0.0) * D)
