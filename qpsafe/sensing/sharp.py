"""The Sharp GP2Y0A02YK infra-red distance sensor: its curve, and how voltages become distances again.

The sensor measures by triangulation. Beyond a peak near 15 cm its voltage falls with the distance like a/(d + b) + c;
nearer than that it falls again towards the surface, so that one voltage has two distances. The paper uses 20 to 80 cm:
nearer is ambiguous, farther is noise.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from qpsafe.errors import ConfigurationError

Array = NDArray[np.float64]

#: Where the voltage is largest [m]; nearer than this a reading means nothing.
PEAK = 0.15
#: Below this [V] the sensor has no supply or a wire is broken: with nothing in sight it still gives more.
DEAD_VOLTAGE = 0.05
#: The supply [V]: no reading is more.
SUPPLY = 5.0
#: Where it is used [m], and the least that a curve falls over this range: a typical one falls by 1.7 [V].
RANGE, LEAST_FALL = (0.2, 0.8), 0.05


@dataclass(frozen=True)
class SharpCurve:
    """The far side of one unit's curve, V(d) = gain/(d + offset) + bias.

    Attributes:
        gain: [V m].
        offset: [m].
        bias: [V].

    Raises:
        ConfigurationError: Not a curve that falls over the sensor's range, at voltages that a sensor can give.
    """

    gain: float = 0.70
    offset: float = 0.08
    bias: float = 0.0

    def __post_init__(self) -> None:
        for key in ("gain", "offset", "bias"):
            value = getattr(self, key)
            number = isinstance(value, int | float) and not isinstance(value, bool)
            if not (number and abs(value) <= sys.float_info.max):
                raise ConfigurationError("SharpCurve", key, value, "a finite number")
        if not self.gain > 0.0:
            raise ConfigurationError("SharpCurve", "gain", self.gain, "a number > 0 [V m]")
        if not self.offset > -PEAK:
            raise ConfigurationError("SharpCurve", "offset", self.offset, f"a number > {-PEAK} [m]")
        near, far = (self.gain / (d + self.offset) + self.bias for d in RANGE)
        if not (near > DEAD_VOLTAGE and far < SUPPLY and near - far >= LEAST_FALL):
            expected = (
                f"a voltage that falls by at least {LEAST_FALL} V, from more than {DEAD_VOLTAGE} V at {RANGE[0]} m to "
                f"less than {SUPPLY} V at {RANGE[1]} m: here from {near:.4g} to {far:.4g} V"
            )
            raise ConfigurationError("SharpCurve", "gain, offset, bias", (self.gain, self.offset, self.bias), expected)

    def voltage(self, distance: ArrayLike) -> Array:
        """Voltage at distances beyond the peak [V]."""
        return self.gain / (np.asarray(distance, dtype=float) + self.offset) + self.bias

    def distance(self, voltage: ArrayLike) -> Array:
        """The inverse: distance [m] of a voltage; +inf at or below the bias."""
        above = np.asarray(voltage, dtype=float) - self.bias
        with np.errstate(over="ignore"):  # a voltage just above the bias
            return np.where(above > 0.0, self.gain / np.where(above > 0.0, above, 1.0) - self.offset, np.inf)


class SharpConverter:
    """Voltages of all spots to distances, by each spot's own curve.

    Distances follow REP 117: within the range they are numbers; beyond it +inf. Nearer than 0.20 m the far side
    of the curve is followed up to its peak, 0.15 m: such a reading is too near to measure but counts as near. A voltage
    that is not a number or below `DEAD_VOLTAGE` (no supply, broken wire) gives NaN, and so does one that stays the same
    to the last bit for `stuck_after` samples: a living sensor has noise.

    Args:
        curves: One a spot.
        range_max: Farther is +inf, (k,) or one number [m].
        stuck_after: Samples; None switches the test off.
    """

    def __init__(self, curves: Sequence[SharpCurve], range_max: ArrayLike = 0.8, stuck_after: int | None = 25) -> None:
        if stuck_after is not None and not stuck_after >= 2:
            raise ConfigurationError("SharpConverter", "stuck_after", stuck_after, "at least 2 samples, or None")
        self.curves = tuple(curves)
        self._gain = np.array([curve.gain for curve in self.curves])
        self._offset = np.array([curve.offset for curve in self.curves])
        self._bias = np.array([curve.bias for curve in self.curves])
        self._range_max = np.broadcast_to(np.asarray(range_max, dtype=float), (len(self.curves),))
        self._stuck_after = stuck_after
        self.reset()

    def reset(self) -> None:
        """Forget past samples."""
        self._last = np.full(len(self.curves), np.nan)
        self._same = np.zeros(len(self.curves), dtype=np.int64)

    def distances(self, voltages: ArrayLike) -> Array:
        """Distances (k,) of one sample of voltages (k,) [m].

        Raises:
            ConfigurationError: Another number of voltages than of curves.
        """
        v = np.asarray(voltages, dtype=float)
        if v.shape != self._gain.shape:
            raise ConfigurationError("SharpConverter", "voltages", v.shape, f"shape {self._gain.shape}")
        # not finite and dead values go before anything is computed with them
        alive = np.isfinite(v) & (v >= DEAD_VOLTAGE)
        if self._stuck_after is not None:
            self._same = np.where(v == self._last, self._same + 1, 1)
            self._last = v.copy()
            alive &= self._same < self._stuck_after
        above = np.where(alive, v, self._bias) - self._bias
        falling = above > 0.0
        d = np.where(falling, self._gain / np.where(falling, above, 1.0) - self._offset, np.inf)
        d = np.where(d <= self._range_max, np.maximum(d, PEAK), np.inf)
        return np.where(alive, d, np.nan)
