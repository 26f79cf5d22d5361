"""Identify each spot's curve from pairs of distance and voltage, by a robust fit, and keep the result in a file."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pydantic import BaseModel, ConfigDict

from qpsafe.errors import ConfigurationError, RobotFileError
from qpsafe.sensing.sharp import RANGE, SharpConverter, SharpCurve
from qpsafe.text.toml_string import toml_string
from qpsafe.text.toml_text import TomlText
from qpsafe.text.words import counted

if TYPE_CHECKING:
    from qpsafe.robot.robot import Robot

Array = NDArray[np.float64]

#: The file in the robot's folder that `load_calibration` reads.
FILE_NAME = "calibration.toml"
#: Range of distances that is fitted, the paper's [m].
FITTED = RANGE
FEWEST = 6  # pairs a spot: twice the number of parameters
#: Farther off the curve than this, and than this many robust standard deviations of the others, a pair is wrong [m].
WRONG, DEVIATIONS = 0.03, 6.0
MOST_WRONG = 0.1  # share of a spot's pairs that may be wrong
#: Voltages over those of a typical unit: what units of this sensor can differ by.
TYPICAL = (0.7, 1.4)
_FALLS = "a voltage that falls with the distance (is m mixed with cm?)"


@dataclass(frozen=True)
class Fit:
    """The curve of one spot and how well it fits.

    Attributes:
        spot: Name.
        curve: Its curve.
        distances: Of the pairs that were fitted (n,) [m].
        voltages: Of the pairs (n,) [V].
        ignored: How many pairs lay outside the fitted range.
    """

    spot: str
    curve: SharpCurve
    distances: Array
    voltages: Array
    ignored: int = 0

    @property
    def errors(self) -> Array:
        """Distance by the curve minus true distance, (n,) [m]."""
        return self.curve.distance(self.voltages) - self.distances

    @property
    def wrong(self) -> NDArray[np.bool_]:
        """Which pairs (n,) are mistakes, such as of somebody who stood in the way: far off what the others agree on."""
        off = np.abs(self.errors)
        return ~(off <= max(WRONG, DEVIATIONS * 1.4826 * float(np.median(off))))

    @property
    def few_wrong(self) -> bool:
        """Whether so few pairs are wrong that the others determine the curve."""
        return int(self.wrong.sum()) <= MOST_WRONG * len(self.distances)

    @property
    def share_within_1_cm(self) -> float:
        """Share of the pairs whose distance the curve gives within 1 cm."""
        return float((np.abs(self.errors) <= 0.01).mean())

    @property
    def error_95(self) -> float:
        """95 % of the pairs that are not wrong are at most this far off [m]."""
        return float(np.percentile(np.abs(self.errors[~self.wrong]), 95.0))


def fit_curve(spot: str, distances: ArrayLike, voltages: ArrayLike) -> Fit:
    """Fit V = gain/(d + offset) + bias to the pairs between 20 and 80 cm.

    The loss is robust (soft L1 with a scale of 1 cm in distance), and up to a tenth of the pairs that are then plainly
    wrong are left out of a second fit: they do not spoil the curve. Voltages are weighted by the slope of the curve, so
    that errors in distance count, not in voltage.

    Args:
        spot: Its name, for errors.
        distances: (pairs,) [m].
        voltages: (pairs,) [V].

    Raises:
        ConfigurationError: Too few pairs, numbers that are not finite, or pairs that are no falling curve.
    """
    d, v = np.asarray(distances, dtype=float), np.asarray(voltages, dtype=float)
    where = f"calibration of {spot}"
    if d.ndim != 1 or d.shape != v.shape or not (np.isfinite(d).all() and np.isfinite(v).all()):
        raise ConfigurationError(where, "pairs", f"arrays of shape {d.shape}, {v.shape}", "finite pairs (n,), (n,)")
    inside = (d >= FITTED[0]) & (d <= FITTED[1])
    ignored = int((~inside).sum())
    d, v = d[inside], v[inside]
    if len(d) < FEWEST or len(np.unique(d)) < 4:
        found = f"{counted(len(d), 'pair')} at {counted(len(np.unique(d)), 'distance')}"
        expected = f"at least {counted(FEWEST, 'pair')} at 4 distances between {FITTED[0]} and {FITTED[1]} m"
        raise ConfigurationError(where, "pairs", found, expected)
    fit = Fit(spot, _fitted(where, d, v), d, v, ignored)
    for end in (d.argmin(), d.argmax()):  # a wrong pair at an end bends the curve to itself, and the others are off
        rest = np.arange(len(d)) != end
        if len(np.unique(d[rest])) >= 4:
            other = Fit(spot, _fitted(where, d[rest], v[rest]), d, v, ignored)
            if np.median(np.abs(other.errors)) < 0.5 * np.median(np.abs(fit.errors)):
                fit = other
    if fit.wrong.any() and fit.few_wrong:  # a robust loss bounds what they do to the curve: now nothing
        fit = Fit(spot, _fitted(where, d[~fit.wrong], v[~fit.wrong]), d, v, ignored)
    if not np.median(np.abs(fit.errors)) <= 0.05:
        worst = f"a median error of {100 * np.median(np.abs(fit.errors)):.3g} cm"
        raise ConfigurationError(where, "pairs", worst, _FALLS)
    return fit


def _fitted(where: str, d: Array, v: Array) -> SharpCurve:
    from scipy.optimize import least_squares

    start = SharpCurve()
    slope = start.gain / (d + start.offset) ** 2  # |dV/dd|: volts per metre

    def residuals(x: Array) -> Array:
        return (x[0] / (d + x[1]) + x[2] - v) / slope / 0.01

    result = least_squares(
        residuals,
        (start.gain, start.offset, start.bias),
        bounds=((1e-3, -0.1, -1.0), (10.0, 1.0, 1.0)),
        loss="soft_l1",
        x_scale=(0.1, 0.02, 0.05),
    )
    try:
        return SharpCurve(*(float(value) for value in result.x))
    except ConfigurationError as problem:  # no sensor's: what the pairs say best is not
        raise ConfigurationError(where, "pairs", f"{problem.key} = {problem.value}", _FALLS) from None


def fit_all(pairs: Iterable[tuple[str, float, float]]) -> list[Fit]:
    """Fit every spot of (spot, distance [m], voltage [V]) rows, in the order of first appearance."""
    groups: dict[str, list[tuple[float, float]]] = {}
    for spot, distance, voltage in pairs:
        groups.setdefault(spot, []).append((distance, voltage))
    return [fit_curve(spot, *np.array(rows).T) for spot, rows in groups.items()]


def implausible(fit: Fit) -> str | None:
    """What is odd about voltages that no Sharp GP2Y0A02YK gives at these distances, or None.

    Units of the sensor differ by some 10 %. Distances in other units, or volts by another reference than that of the
    converter, may fit a curve as well as right ones do.
    """
    d, v, typical = fit.distances, fit.voltages, SharpCurve()
    ratio = float(np.median(v / typical.voltage(d)))
    if TYPICAL[0] <= ratio <= TYPICAL[1]:
        return None
    guesses = {
        "distances in feet": np.median(v / typical.voltage(0.3048 * d)),
        "a converter with a reference of 3.3 V taken for one of 5 V": ratio * 3.3 / 5.0,
        "a converter with a reference of 5 V taken for one of 3.3 V": ratio * 5.0 / 3.3,
    }
    name, value = min(guesses.items(), key=lambda item: abs(math.log(max(float(item[1]), 1e-9))))
    guess = f"; {name}?" if 1.0 / 1.2 <= value <= 1.2 else ""
    return f"{ratio:.2f} times the voltages of a typical sensor{guess}"


class _Curve(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True, strict=True)
    spot: str
    gain: float
    offset: float
    bias: float
    error_95: float | None = None
    pairs: int | None = None
    wrong: int | None = None


class _File(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)
    sensor: str
    curve: list[_Curve]


def calibration_text(fits: Sequence[Fit], sensor: str = "Sharp GP2Y0A02YK") -> str:
    """The contents of a calibration file."""
    lines = [
        "# Written by `qpsafe calibrate`. V(d) = gain/(d + offset) + bias, 0.20 to 0.80 m.",
        "# error_95: 95 % of the pairs are at most this far off [m], those left out that are plainly wrong.",
        f"sensor = {toml_string(sensor)}",
    ]
    for fit in fits:
        lines += ["", "[[curve]]", f"spot = {toml_string(fit.spot)}"]
        lines += [f"{key} = {getattr(fit.curve, key)!r}" for key in ("gain", "offset", "bias")]
        lines += [f"error_95 = {fit.error_95:.5f}", f"pairs = {len(fit.distances)}", f"wrong = {fit.wrong.sum()}"]
    return "\n".join(lines) + "\n"


def read_calibration(path: Path) -> dict[str, SharpCurve]:
    """Curves by spot name from a calibration file.

    Raises:
        RobotFileError: The file is missing, is no TOML, or a value in it is wrong.
    """
    text = TomlText.read(path, RobotFileError)
    curves: dict[str, SharpCurve] = {}
    for k, item in enumerate(text.checked(_File).curve):
        if item.spot in curves:
            raise text.wrong(("curve", k, "spot"), item.spot, "one curve a spot")
        try:
            curves[item.spot] = SharpCurve(item.gain, item.offset, item.bias)
        except ConfigurationError as problem:
            key = (problem.key,) if problem.key in _Curve.model_fields else ()
            raise text.wrong(("curve", k, *key), problem.value, f"{problem.expected}, of spot {item.spot!r}") from None
    return curves


def load_converter(robot: Robot, path: Path | None = None) -> SharpConverter:
    """Voltages to distances for a robot's spots, by the `calibration.toml` in its folder.

    Args:
        robot: The robot, with spots.
        path: Another calibration file.

    Raises:
        RobotFileError: The robot has no spots, the file is missing or wrong, or a spot has no curve in it.
    """
    from qpsafe.sensing.skin.spots import load_spots

    path = robot.folder / FILE_NAME if path is None else path
    spots = load_spots(robot)
    if spots is None:
        raise RobotFileError(robot.folder, "spots", None, "a robot with distance sensors")
    curves = read_calibration(path)
    for name in spots.names:
        if name not in curves:
            raise RobotFileError(path, "curve", list(curves), f"a curve of spot {name!r} too")
    return SharpConverter([curves[name] for name in spots.names], spots.range_max)
