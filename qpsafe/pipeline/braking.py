"""What is commanded where nothing else can be: braking towards standstill."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numba import types
from numpy.typing import NDArray

from qpsafe.compiled.compiled import entry, readable
from qpsafe.danger.evasion import Evasion
from qpsafe.errors import in_words
from qpsafe.gate import braking_path
from qpsafe.gate.braking_path import slow_down
from qpsafe.limits import Box, JointLimits
from qpsafe.pipeline.resolved import given_way
from qpsafe.sensing.detection import reals

if TYPE_CHECKING:
    from qpsafe.robot.robot import Robot

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


@entry(types.void(readable(1), readable(1), types.float64, types.float64[::1]), braking_path)
def _slow_down(qd: Array, acceleration: Array, dt: float, slower: Array) -> None:
    slow_down(qd, acceleration, dt, slower)


def slower(limits: JointLimits, qd: Array) -> Array:
    """The velocity qd (n,) [rad/s] a tick later, braked as hard as allowed: inside the box."""
    braked = np.empty(len(qd))
    _slow_down(qd, limits.max_acceleration, limits.dt, braked)
    return braked


def brake(limits: JointLimits, evasion: Evasion, motion: tuple[Array, Array, Array], robot: Robot) -> Braked:
    """Brake with the largest acceleration, jerk limits or not; never raises, whatever the evasion is.

    Args:
        limits: Plain limits, none of another making.
        evasion: The admittance.
        motion: Commanded position, velocity, and the acceleration that led to it (n,) [rad, rad/s, rad/s²].
        robot: Whose joints these are.
    """
    q, qd, _ = motion
    none = np.zeros(len(q))
    messages: tuple[str, ...] = ()
    try:
        qd0 = reals("the evasion's velocity", evasion.step(none), none.shape).copy()  # no danger is known: it fades
    except Exception as error:  # an evasion of another making
        qd0, messages = none, (in_words(error),)
    command, box = slower(limits, qd), limits.box(*motion)
    return Braked(command, box, qd0, (*messages, *given_way(box, robot.joint_names, command)))
