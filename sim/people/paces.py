"""How a movement goes from rest to rest: the share of it that is done at a share of its time.

- `eased`, the integral of a raised cosine: peak 2 times the mean speed, at the middle.
- `minimum_jerk`: 10 u³ - 15 u⁴ + 6 u⁵, peak 1.875 times the mean at the middle (Flash and Hogan 1985). Fast arms peak
  late (Nagasaki 1989): with `late` = 1 the speed goes as u³ (1 - u)², its peak is 2.07 times the mean, at 60 % of the
  time.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

COSINE = -1.0  # in place of `late`: the raised cosine


def eased(share: Array) -> Array:
    """From 0 to 1 for shares of time 0 to 1, at rest at both ends; the integral of the kernel. Fastest rate: 2."""
    share = np.minimum(np.maximum(share, 0.0), 1.0)
    found: Array = share - np.sin(2.0 * math.pi * share) / (2.0 * math.pi)
    return found


def ramped(times: Array, ease: Array | float) -> Array:
    """max(time, 0) smoothed by the kernel of width `ease`: the integral of `eased` [s]."""
    u = np.minimum(np.maximum(times / ease, -0.5), 0.5)
    bend: Array = ease * (0.5 * u * u + 0.5 * u + 0.125 - (1.0 + np.cos(2.0 * math.pi * u)) / (4.0 * math.pi**2))
    return np.where(np.abs(times) < 0.5 * ease, bend, np.maximum(times, 0.0))


def minimum_jerk(share: Array, late: Array | float = 0.0) -> Array:
    """From 0 to 1 for shares of time 0 to 1; `late`, 0 to 1, moves the peak of the speed towards 60 % of the time."""
    u = np.minimum(np.maximum(share, 0.0), 1.0)
    middle = u**3 * (10.0 + u * (-15.0 + 6.0 * u))
    end = u**4 * (15.0 + u * (-24.0 + 10.0 * u))  # integral of 60 u^3 (1 - u)^2
    found: Array = middle + late * (end - middle)
    return found


def paced(share: Array, late: Array) -> Array:
    """`minimum_jerk` where `late` is 0 or more, else `eased`."""
    return np.where(late < 0.0, eased(share), minimum_jerk(share, late))


def peak(late: float) -> float:
    """At most so many times its mean speed is the fastest of a movement."""
    return 2.0 if late < 0.0 else (1.0 - late) * 1.875 + late * 2.0736
