"""What is commanded where nothing else can be: braking towards standstill."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from qpsafe.danger.evasion import Evasion
from qpsafe.errors import in_words
from qpsafe.limits import Box, JointLimits

Array = NDArray[np.float64]


class Braked(NamedTuple):
    """A tick of braking.

    Attributes:
        command: Joint velocity (n,) [rad/s].
        box: Admissible velocities.
        qd0: Evasive velocity (n,) [rad/s], which fades.
        messages: What failed meanwhile, in words.
    """

    command: Array
    box: Box
    qd0: Array
    messages: tuple[str, ...]


def brake(limits: JointLimits, evasion: Evasion, q: Array, qd: Array) -> Braked:
    """Brake with the largest acceleration; never raises, whatever the evasion is.

    Args:
        limits: Plain limits, none of another making.
        evasion: The admittance.
        q, qd: Commanded position and velocity (n,) [rad, rad/s].
    """
    none, most = np.zeros(len(q)), limits.max_acceleration * limits.dt
    slower = qd - np.clip(qd, -most, most)  # inside the box, whose speeds can all be braked
    messages: tuple[str, ...] = ()
    try:
        qd0 = np.array(evasion.step(none))  # no danger is known: what was known fades
    except Exception as error:  # an evasion of another making
        qd0, messages = none, (in_words(error),)
    return Braked(slower, limits.box(q, qd), qd0, messages)
