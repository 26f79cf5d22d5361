"""Identify each spot's curve from pairs of distance and voltage, by a robust fit, and keep the result in a file."""

from __future__ import annotations

import csv
import math
import tomllib
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pydantic import BaseModel, ConfigDict, ValidationError

from qpsafe.errors import ConfigurationError, RobotFileError
from qpsafe.sensing.sharp import SharpConverter, SharpCurve
from qpsafe.words import counted

if TYPE_CHECKING:
    from qpsafe.robot.robot import Robot

Array = NDArray[np.float64]

#: The file in the robot's folder that `load_calibration` reads.
FILE_NAME = "calibration.toml"
#: Range of distances that is fitted, the source's [m].
FITTED = (0.20, 0.80)
FEWEST = 6  # pairs a spot: twice the number of parameters
_COLUMNS = ("spot", "distance", "voltage")


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
    def share_within_1_cm(self) -> float:
        """Share of the pairs whose distance the curve gives within 1 cm."""
        return float((np.abs(self.errors) <= 0.01).mean())

    @property
    def error_95(self) -> float:
        """95 % of the pairs are at most this wrong [m]."""
        return float(np.percentile(np.abs(self.errors), 95.0))


def fit_curve(spot: str, distances: ArrayLike, voltages: ArrayLike) -> Fit:
    """Fit V = gain/(d + offset) + bias to the pairs between 20 and 80 cm.

    The loss is robust (soft L1 with a scale of 1 cm in distance): a few wrong pairs do not spoil the curve. Voltages
    are weighted by the slope of the curve, so that errors in distance count, not in voltage.

    Raises:
        ConfigurationError: Too few pairs, numbers that are not finite, or pairs that are no falling curve.
    """
    from scipy.optimize import least_squares

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
    curve = SharpCurve(*(float(value) for value in result.x))
    fit = Fit(spot, curve, d, v, ignored)
    if not np.median(np.abs(fit.errors)) <= 0.05:
        worst = f"a median error of {100 * np.median(np.abs(fit.errors)):.3g} cm"
        raise ConfigurationError(where, "pairs", worst, "a voltage that falls with the distance (is m mixed with cm?)")
    return fit


def fit_all(pairs: Iterable[tuple[str, float, float]]) -> list[Fit]:
    """Fit every spot of (spot, distance [m], voltage [V]) rows, in the order of first appearance."""
    groups: dict[str, list[tuple[float, float]]] = {}
    for spot, distance, voltage in pairs:
        groups.setdefault(spot, []).append((distance, voltage))
    return [fit_curve(spot, *np.array(rows).T) for spot, rows in groups.items()]


def read_pairs(path: Path) -> list[tuple[str, float, float]]:
    """Pairs of a CSV file with the columns spot, distance [m], voltage [V], in any order, others ignored.

    Raises:
        ConfigurationError: Names the file, the line and the value that is wrong.
    """
    try:
        text = path.read_text(encoding="utf-8-sig")
    except (OSError, UnicodeDecodeError) as error:
        raise ConfigurationError(path, "file", path.name, f"a readable CSV file in UTF-8 ({error})") from None
    reader = csv.reader(text.splitlines())
    header = [cell.strip().lower() for cell in next(reader, [])]
    for name in _COLUMNS:
        if header.count(name) != 1:
            raise ConfigurationError(path, "line 1", ",".join(header), f"the columns {', '.join(_COLUMNS)}")
    places = [header.index(name) for name in _COLUMNS]
    pairs = []
    for row in reader:
        if not "".join(row).strip():
            continue
        key = f"line {reader.line_num}"
        if len(row) <= max(places) or not row[places[0]].strip():
            raise ConfigurationError(path, key, ",".join(row), "a spot, a distance and a voltage")
        values = [
            _number(path, f"{key}, {name}", row[place]) for name, place in zip(_COLUMNS[1:], places[1:], strict=True)
        ]
        if not 0.0 < values[0] <= 5.0:
            raise ConfigurationError(path, f"{key}, distance", values[0], "a distance in metres, 0 to 5")
        if not 0.0 <= values[1] <= 5.0:
            raise ConfigurationError(path, f"{key}, voltage", values[1], "a voltage in volts, 0 to 5")
        pairs.append((row[places[0]].strip(), values[0], values[1]))
    if not pairs:
        raise ConfigurationError(path, "rows", 0, "at least one pair")
    return pairs


def _number(path: Path, key: str, text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise ConfigurationError(path, key, text, "a finite number (decimal point, no unit)")
    return value


class _Curve(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True, strict=True)
    spot: str
    gain: float
    offset: float
    bias: float
    error_95: float | None = None
    pairs: int | None = None


class _File(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)
    sensor: str
    curve: list[_Curve]


def calibration_text(fits: Sequence[Fit], sensor: str = "Sharp GP2Y0A02YK") -> str:
    """The contents of a calibration file."""
    lines = [
        "# Written by `qpsafe calibrate`. V(d) = gain/(d + offset) + bias, 0.20 to 0.80 m.",
        "# error_95: 95 % of the pairs are at most this wrong [m].",
        f'sensor = "{sensor}"',
    ]
    for fit in fits:
        name = fit.spot.replace("\\", "\\\\").replace('"', '\\"')
        lines += ["", "[[curve]]", f'spot = "{name}"']
        lines += [f"{key} = {getattr(fit.curve, key)!r}" for key in ("gain", "offset", "bias")]
        lines += [f"error_95 = {fit.error_95:.5f}", f"pairs = {len(fit.distances)}"]
    return "\n".join(lines) + "\n"


def read_calibration(path: Path) -> dict[str, SharpCurve]:
    """Curves by spot name from a calibration file.

    Raises:
        RobotFileError: The file is missing, is no TOML, or a value in it is wrong.
    """
    try:
        content = _File.model_validate(tomllib.loads(path.read_text(encoding="utf-8")))
    except (OSError, UnicodeDecodeError, tomllib.TOMLDecodeError) as error:
        raise RobotFileError(path, "file", path.name, f"a readable TOML file ({error})") from None
    except ValidationError as error:
        first = error.errors()[0]
        key = ".".join(str(part) for part in first["loc"])
        raise RobotFileError(path, key, first.get("input"), first["msg"]) from None
    curves: dict[str, SharpCurve] = {}
    for item in content.curve:
        if item.spot in curves:
            raise RobotFileError(path, "curve", item.spot, "one curve a spot")
        curves[item.spot] = SharpCurve(item.gain, item.offset, item.bias)
    return curves


def load_converter(robot: Robot, path: Path | None = None) -> SharpConverter:
    """Voltages to distances for a robot's spots, by the `calibration.toml` in its folder.

    Args:
        robot: The robot, with spots.
        path: Another calibration file.

    Raises:
        RobotFileError: The robot has no spots, the file is missing or wrong, or a spot has no curve in it.
    """
    from qpsafe.sensing.spots import load_spots

    path = robot.folder / FILE_NAME if path is None else path
    spots = load_spots(robot)
    if spots is None:
        raise RobotFileError(robot.folder, "spots", None, "a robot with distance sensors")
    curves = read_calibration(path)
    for name in spots.names:
        if name not in curves:
            raise RobotFileError(path, "curve", list(curves), f"a curve of spot {name!r} too")
    return SharpConverter([curves[name] for name in spots.names], spots.range_max)
