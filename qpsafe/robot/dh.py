"""Standard Denavit-Hartenberg chains, used to check a model against the table its maker publishes."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray


def dh_frames(
    table: NDArray[np.float64], q: NDArray[np.float64], sliding: NDArray[np.bool_] | None = None
) -> NDArray[np.float64]:
    """Poses of the frames of a standard Denavit-Hartenberg table: T(i-1, i) = Rz(q + theta) Tz(d) Tx(a) Rx(alpha).

    Where a joint slides, q is added to d instead of theta.

    Args:
        table: Columns theta, d, a, alpha, (n, 4) [rad, m, m, rad].
        q: Joint positions, (n,) [rad].
        sliding: Which joints slide, (n,); none if not given.

    Returns:
        Frame 0 (the identity) to frame n, (n + 1, 4, 4).
    """
    poses = [np.eye(4)]
    slides = np.zeros(len(table), dtype=bool) if sliding is None else sliding
    for (theta, d0, a, alpha), qj, slide in zip(table, q, slides, strict=True):
        qi, d = (0.0, d0 + qj) if slide else (qj, d0)
        ct, st = np.cos(theta + qi), np.sin(theta + qi)
        ca, sa = np.cos(alpha), np.sin(alpha)
        step = np.array(
            [
                [ct, -st * ca, st * sa, a * ct],
                [st, ct * ca, -ct * sa, a * st],
                [0.0, sa, ca, d],
                [0.0, 0.0, 0.0, 1.0],
            ]
        )
        poses.append(poses[-1] @ step)
    return np.array(poses)
