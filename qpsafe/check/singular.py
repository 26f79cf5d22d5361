"""How near a path comes to singular poses, in which the tool cannot move in some direction whatever the joints do."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from qpsafe.check.path import NominalPath

Array = NDArray[np.float64]

#: Below this smallest singular value of the frame's Jacobian, in m and rad, a pose counts as singular: 0.02 is what
#: `HierarchicalLaw(damping=...)` is told to damp from. A motion of 0.1 m/s in that direction takes 5 rad/s.
SINGULAR = 0.02
_INVOLVED = 0.3  # share of the direction that a joint must have to be named


class NearSingular(NamedTuple):
    """The pose of a path that is nearest to a singular one.

    Attributes:
        value: Smallest singular value of the Jacobian, of m and rad.
        condition: Largest by smallest; +inf in a singular pose.
        time: When [s].
        position: Where the frame is then (3,) [m].
        joints: Names of those that move most where the frame hardly does.
    """

    value: float
    condition: float
    time: float
    position: Array
    joints: tuple[str, ...]


def smallest_values(path: NominalPath) -> Array:
    """Smallest singular value of the Jacobian at every moment, (N,)."""
    count = min(path.jacobians.shape[1:])
    return np.asarray(np.linalg.svd(path.jacobians, compute_uv=False)[:, count - 1], dtype=float)


def nearest_singular(path: NominalPath, names: tuple[str, ...], values: Array) -> NearSingular | None:
    """The pose nearest to a singular one; None for a path without a moment.

    Args:
        path: The path.
        names: Of the joints.
        values: Its `smallest_values`.
    """
    if not len(values):
        return None
    k = int(values.argmin())
    _, sigma, directions = np.linalg.svd(path.jacobians[k])
    last = min(len(sigma), len(names)) - 1
    involved = [name for name, share in zip(names, np.abs(directions[last]), strict=True) if share > _INVOLVED]
    condition = float(sigma[0] / sigma[last]) if sigma[last] > 0.0 else np.inf
    return NearSingular(float(values[k]), condition, float(path.times[k]), path.tool[k], tuple(involved))
