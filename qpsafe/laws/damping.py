"""How near to a singular pose a task is damped: by what it still has to correct.

Where a task would have to pass a singular pose to get rid of its error but cannot, its undamped velocity e/σ points
at σ = 0 from both sides, and the robot is thrown to and fro at the joints' limits for ever. Damped below ε, see
`qpsafe.hqp.own.damping`, it moves by σ K e/ε² there: it comes to rest like x' = -k x, k = c K |e|/ε², c the curvature
|d²x/dq²| of the arm (about 1 m/rad², 1/rad). With

    ε² = floor² + μ Σ_(j<=k) K_j |e_j|

k <= c/μ whatever the error, slow enough for the tick and the joints' accelerations; and ε goes to zero with the errors:
where tasks are met, even in motion, nothing is damped. The tasks above count, since their corrections are what the
task itself has to make up for.
"""

from __future__ import annotations

from math import sqrt

from qpsafe.compiled.compiled import inline
from qpsafe.hqp.own.linear import Array

#: μ [s] where nothing else is said: ten ticks of 4 ms; see docs/explanation/laws.md.
DAMPING_TIME = 0.04
_HUGE = 1e60
#: Neither a damping nor its time may be larger: ε² would be beyond `_HUGE`.
MOST = 1e30


def threshold(square: float, gain: float, error: Array, time: float) -> tuple[float, float]:
    """ε² and ε below which singular values of a task are damped; ε = 0 where that is not finite.

    Args:
        square: ε² of the task above; floor² for the first one.
        gain: K [1/s]; 1 where `error` is K e already.
        error: e (rows,) [m, rad].
        time: μ [s].
    """
    total = 0.0
    for i in range(error.shape[0]):
        total += (gain * error[i]) * (gain * error[i])
    square += time * sqrt(total)
    return square, sqrt(square) if square < _HUGE else 0.0


threshold_compiled = inline(threshold)
