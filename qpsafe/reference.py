"""What the industrial controller is given at every tick."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray


class ServoGains(NamedTuple):
    """Gains of a joint servo that the controller may set: a speed loop inside a position loop, arm side.

    torque = Kv (v_ref - q̇) + Ki ∫(v_ref - q̇) dt + trqFfw with v_ref = velRef + Kp (posRef - q).

    Attributes:
        kp: Position loop (n,) [1/s].
        kv: Speed loop (n,) [N m s/rad].
        ki: Integral of the speed loop (n,) [N m/rad].
    """

    kp: NDArray[np.float64]
    kv: NDArray[np.float64]
    ki: NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class JointReference:
    """Joint references of one tick, arm side, SI. For the motor side, see `qpsafe.irc5.records.gears`.

    Two references are equal if all their numbers are, NaN included.

    Attributes:
        seq: Number of the tick, counting from 0.
        time: seq * dt [s].
        q: Position reference, posRef (n,) [rad], finite and within limits.
        qd: Velocity reference, velRef (n,) [rad/s]; `q` is the last `q` plus `qd` dt.
        active: False until a first valid measurement told where the robot is: do not move on such a reference.
        torque: Torque feed-forward, trqFfw (n,) [N m]; None for none, as EGM has no place for it.
        gains: Gains that the servo shall use, Kp, Kv, Ki; None for its own.
    """

    seq: int
    time: float
    q: NDArray[np.float64]
    qd: NDArray[np.float64]
    active: bool = True
    torque: NDArray[np.float64] | None = None
    gains: ServoGains | None = None

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, JointReference):
            return NotImplemented
        return all(same(getattr(self, part.name), getattr(other, part.name)) for part in fields(self))

    __hash__ = None  # type: ignore[assignment]  # holds arrays


def same(a: Any, b: Any) -> bool:
    """Whether two values, arrays or tuples of them say the same; NaN is equal to NaN."""
    if isinstance(a, tuple) and isinstance(b, tuple):
        return len(a) == len(b) and all(map(same, a, b))
    if a is None or b is None or isinstance(a, str | tuple | bool) or isinstance(b, str | tuple | bool):
        return bool(a is b or (type(a) is type(b) and a == b))
    return np.array_equal(a, b, equal_nan=True) if isinstance(a, np.ndarray | float) else bool(a == b)
