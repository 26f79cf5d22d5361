"""Twenty Sharp GP2Y0A02YK as they are: spread, ambiguous near side, noise, sampling, filters, delay, dropouts."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from qpsafe.errors import ConfigurationError
from qpsafe.sensing.sharp import SharpCurve
from qpsafe.sensing.skin.calibration import Fit, fit_curve

Array = NDArray[np.float64]


@dataclass(frozen=True)
class SharpModel:
    """Figures of the sensor and its acquisition. What the data sheet does not say is chosen by us (*).

    Attributes:
        spread: Standard deviation of gain and offset between units, relative (*).
        bias_spread: Standard deviation of the bias between units [V] (*).
        near: Scale of the near side, where the spot of light leaves the detector: V falls like 1 - exp(-(d/near)³) [m].
        noise: Standard deviation of one sample, before the digital low pass [V] (*).
        cycle: The sensor measures once in this time and keeps its voltage meanwhile, 38 ms by its data sheet [s].
        analogue: Cut-off of the analogue low pass [Hz] (*).
        digital: Cut-off of the digital low pass [Hz] (*).
        bits: Of the converter; the paper has 12.
        full_scale: Voltage that the converter saturates at [V] (*).
        delay: Further delay, in whole samples [s].
        dropout: Probability that a sample is lost and reads 0 V.
        dt: Sample time [s]; the paper has 250 Hz.
    """

    spread: float = 0.05
    bias_spread: float = 0.02
    near: float = 0.11
    noise: float = 0.008
    cycle: float = 0.038
    analogue: float = 50.0
    digital: float = 12.0
    bits: int = 12
    full_scale: float = 5.0
    delay: float = 0.0
    dropout: float = 0.0
    dt: float = 0.004

    def __post_init__(self) -> None:
        for key in ("spread", "bias_spread", "noise", "cycle", "delay"):
            if not 0.0 <= getattr(self, key) < np.inf:
                raise ConfigurationError("SharpModel", key, getattr(self, key), "a finite number >= 0")
        for key in ("near", "analogue", "digital", "full_scale", "dt", "bits"):
            if not 0.0 < getattr(self, key) < np.inf:
                raise ConfigurationError("SharpModel", key, getattr(self, key), "a finite number > 0")
        if not 0.0 <= self.dropout <= 1.0:
            raise ConfigurationError("SharpModel", "dropout", self.dropout, "a probability")


class SharpSensors:
    """k units: true distances in at 250 Hz, filtered voltages out.

    Args:
        count: k.
        model: Figures.
        seed: Of spread and noise; equal seeds give equal voltages.
        noise: Seed of other noise of the same units.
    """

    def __init__(self, count: int, model: SharpModel | None = None, seed: int = 0, noise: int | None = None) -> None:
        self.model = model = SharpModel() if model is None else model
        self._rng = np.random.default_rng((seed, 1) if noise is None else (seed, 1, noise))
        spread = np.random.default_rng((seed, 0))
        gain, offset = 1.0 + model.spread * np.clip(spread.normal(size=(2, count)), -2.5, 2.5)
        bias = model.bias_spread * np.clip(spread.normal(size=count), -2.5, 2.5)
        typical = SharpCurve()
        self._curve = (typical.gain * gain, typical.offset * offset, typical.bias + np.maximum(bias, -0.04))
        self._phase = spread.uniform(0.0, 1.0, count)  # the units measure independently of each other
        self._noise_free = np.full(count, np.nan)
        self._analogue = self._digital = np.full(count, np.nan)
        self._cycle = np.full(count, -1, dtype=np.int64)
        self._queue: deque[Array] = deque()
        self._k = 0

    def curves(self) -> list[SharpCurve]:
        """The true far side of every unit, which a calibration should find."""
        return [SharpCurve(*map(float, row)) for row in zip(*self._curve, strict=True)]

    def voltage(self, distances: ArrayLike) -> Array:
        """Noise-free steady voltages at distances (..., k) [m], near side included; nothing in sight at +inf."""
        d = np.asarray(distances, dtype=float)
        gain, offset, bias = self._curve
        near = 1.0 - np.exp(-((np.minimum(d, 10.0) / self.model.near) ** 3))
        floor = 0.12  # [V], what is left with nothing in sight
        return np.maximum(gain / (np.minimum(d, 100.0) + offset) * near + bias, np.where(d > 0.5, floor, 0.0))

    def sample(self, distances: ArrayLike) -> Array:
        """Take the true distances (k,) of this moment [m] and return the voltages acquired, (k,) [V]."""
        m = self.model
        # the sensor: measures now and then, keeps its voltage in between
        cycle = np.floor(self._k * m.dt / m.cycle + self._phase).astype(np.int64) if m.cycle else np.full(1, self._k)
        self._noise_free = np.where(cycle != self._cycle, self.voltage(distances), self._noise_free)
        self._cycle = np.broadcast_to(cycle, self._noise_free.shape).copy()
        # analogue low pass of first order, sampled exactly for a held input; noise; converter
        self._analogue = _low_pass(self._analogue, self._noise_free, m.analogue, m.dt)
        step = m.full_scale / (2**m.bits - 1)
        noisy = self._analogue + m.noise * self._rng.normal(size=len(self._analogue))
        codes = np.round(np.clip(noisy, 0.0, m.full_scale) / step)
        lost = self._rng.random(len(codes)) < m.dropout
        self._digital = _low_pass(self._digital, codes * step, m.digital, m.dt)
        self._k += 1
        self._queue.append(np.where(lost, 0.0, self._digital))
        return self._queue.popleft() if len(self._queue) > round(m.delay / m.dt) else self._queue[0].copy()

    def calibrate(self, distances: ArrayLike, samples: int = 50) -> list[tuple[int, float, float]]:
        """Pairs as a person would take them: (unit, distance [m], mean voltage of some samples [V])."""
        rows = []
        for d in np.atleast_1d(np.asarray(distances, dtype=float)):
            count = len(self._phase)
            for _ in range(40):  # let the filters settle
                self.sample(np.full(count, d))
            mean = np.mean([self.sample(np.full(count, d)) for _ in range(samples)], axis=0)
            rows += [(i, float(d), float(mean[i])) for i in range(count)]
        return rows

    def identified(self, names: tuple[str, ...]) -> list[Fit]:
        """Every unit's curve, identified from a calibration with a board every 5 cm from 20 to 80 cm."""
        pairs = self.calibrate(np.linspace(0.20, 0.80, 13))
        return [
            fit_curve(name, *np.array([(d, v) for unit, d, v in pairs if unit == i]).T) for i, name in enumerate(names)
        ]


def _low_pass(state: Array, value: Array, cutoff: float, dt: float) -> Array:
    """y <- y + (1 - exp(-2π f dt)) (u - y); starts at its first input."""
    share = 1.0 - np.exp(-2.0 * np.pi * cutoff * dt)
    return np.where(np.isnan(state), value, state + share * (value - state))
