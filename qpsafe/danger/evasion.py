"""Evasive motion, eq. (16): virtual torque through an admittance filter, with friction where nobody comes."""

from __future__ import annotations

from math import copysign, inf
from typing import TYPE_CHECKING, Any

import numpy as np
from numba import types
from numpy.typing import ArrayLike, NDArray

from qpsafe.compiled.compiled import entry, readable
from qpsafe.danger.levers import levers
from qpsafe.danger.torque import link_vectors as link_vectors
from qpsafe.danger.torque import virtual_torque as virtual_torque
from qpsafe.errors import ConfigurationError
from qpsafe.text.given import number, numbers, whole
from qpsafe.text.words import call

if TYPE_CHECKING:
    from qpsafe.danger.activation import Threshold
    from qpsafe.robot.robot import Robot


#: Where a point is known to move as fast as this, or faster, there is no friction [m/s].
STANDING = 0.3


@entry(types.void(readable(2), readable(2), readable(1), readable(1), types.float64[::1]))
def filter_by(A, B, before, sigma, after):  # type: ignore[no-untyped-def]
    """after = A before + B σ."""
    for i in range(len(before)):
        after[i] = 0.0
        for j in range(len(before)):
            after[i] += A[i, j] * before[j] + B[i, j] * sigma[j]


@entry(types.void(types.float64[::1], readable(1), types.float64))
def rub(velocity, drop, coming):  # type: ignore[no-untyped-def]
    """Dry friction: take `drop` (n,) [rad/s] from the joints' speeds, less of it the faster somebody comes [m/s]."""
    share = 1.0 - coming / STANDING
    if share > 0.0:
        for j in range(velocity.shape[0]):
            if abs(velocity[j]) > share * drop[j]:
                velocity[j] -= copysign(share * drop[j], velocity[j])
            elif velocity[j] == velocity[j]:  # NaN stays, and is seen
                velocity[j] = 0.0


#: The rule's friction: which share of the danger Δ(1-ε) at one point moves no joint while nobody comes.
RESTING = 0.5
#: Virtual mass [N m s²/rad] and damping [N m s/rad] of every joint that were tuned on the first experiment.
PAPER_MASS, PAPER_DAMPING = 4.0, 20.0
#: The rule of `Evasion.for_robot`: shares of a joint's largest speed and of the time in which it gets there.
SPEED_SHARE, TIME_SHARE = 0.5, 0.3
#: How many times the damping of the joint that moves the wire fastest a joint may need and still share one D with it.
SLOW = 2.0
MOST_JOINTS = 1000  # a robot can have; beyond it matrices do not fit anywhere


class Evasion:
    """Mass-damper admittance q̇0 = (M s + D)^-1 σ, eq. (16), sampled exactly for a held input; with friction if wanted.

    Friction is ours, not the paper's: M q̈0 + D q̇0 + c sgn(q̇0) = σ. An arm that creeps away from somebody who stands
    gains little room, and who is not seen touches it while it moves; with friction it comes to rest. It counts in full
    where no point comes nearer, not at all where one does at `STANDING` or faster, or nobody knows how fast. Who passes
    by counts by the part of the velocity that comes nearer; what is held unseen counts as standing, what a spot has
    only just seen as coming.

    Args:
        mass: M, scalar, (n,) diagonal or (n, n) symmetric positive definite.
        damping: D, likewise. D sets the steady speed D^-1 σ, D/M how fast it is reached.
        n: Number of joints.
        dt: Sample time [s].
        friction: c, scalar or (n,), not negative [N m]; 0 where M or D is not diagonal.

    Raises:
        ConfigurationError: A matrix not symmetric positive definite; a friction < 0, or beside coupled joints; dt <= 0.
    """

    def __init__(
        self, mass: ArrayLike, damping: ArrayLike, n: int, dt: float = 0.004, friction: ArrayLike = 0.0
    ) -> None:  # fmt: skip
        from scipy.linalg import expm

        self._dt = number("Evasion", "dt", dt, "a finite time > 0 [s]", above=0.0)
        n = whole("Evasion", "n", n, "a whole number of joints, at least 1", 1, MOST_JOINTS)
        self._mass = _positive_definite(mass, n, "mass")
        self._damping = _positive_definite(damping, n, "damping")
        self._friction = _not_negative(friction, n, "friction")
        # zero-order hold: q̇0 <- A q̇0 + (I - A) D^-1 σ,  A = expm(-M^-1 D dt)
        with np.errstate(over="ignore", invalid="ignore"):
            rates = np.linalg.solve(self._mass, self._damping) * self._dt
            if np.isfinite(rates).all():
                self._A = expm(-rates)
                self._B = np.linalg.solve(self._damping.T, (np.eye(n) - self._A).T).T
                self._drop = self._B.diagonal() * self._friction
        if not (np.isfinite(rates).all() and np.isfinite(self._A).all() and np.isfinite(self._B).all()):
            raise ConfigurationError("Evasion", "damping", damping, "numbers that can be divided by those of mass")
        coupled = any(np.count_nonzero(matrix) > n for matrix in (self._mass, self._damping))
        if coupled and self._friction.any():  # an impulse at one joint would move the others
            raise ConfigurationError("Evasion", "friction", friction, "0 where mass or damping is not diagonal")
        if not np.isfinite(self._drop).all():
            raise ConfigurationError("Evasion", "friction", friction, "numbers that can be divided by those of damping")
        self._velocity = np.zeros(n)
        self.__setstate__({})

    def __getstate__(self) -> dict[str, Any]:
        """A copy is nobody's yet."""
        return {key: value for key, value in self.__dict__.items() if key != "_owner"}

    def __setstate__(self, state: dict[str, Any]) -> None:
        """Unpickled and copied arrays can be written to again."""
        self.__dict__.update(state)
        for array in (self._mass, self._damping, self._A, self._B, self._friction, self._drop):
            array.flags.writeable = False

    def __repr__(self) -> str:
        friction = {"friction": self._friction} if self._friction.any() else {}
        return call(self, mass=np.diag(self._mass), damping=np.diag(self._damping), dt=self._dt, **friction)

    @classmethod
    def paper(cls, n: int, dt: float) -> Evasion:
        """M = 4, D = 20 for every joint, tuned on the first experiment by hand.

        Args:
            n: Number of joints.
            dt: Sample time [s].
        """
        return cls(PAPER_MASS, PAPER_DAMPING, n, dt)

    @classmethod
    def for_robot(cls, robot: Robot, dt: float) -> Evasion:
        """M, D and friction that the robot's file states, else from its limits and geometry; a controller's default.

        Let ℓ_j be the longest lever of joint j, the largest |(J_(i-1) + J_i)_j| over links and configurations: a danger
        Δ at one point causes a torque of at most Δ ℓ_j there, see (14), (15). Then

            D = max_j Δ ℓ_j/(s v_j),    M_j = D b v_j/a_j,

        with Δ where the task of highest priority begins to be released, Δ(1-ε). So one point of that danger turns no
        joint faster than s = 1/2 of its largest speed v_j, two of them, or twice the danger, none faster than v_j:
        beyond that the limits cut single joints, which turns the direction of the evasion. D is the same for all joints
        so that q̇0 follows the steepest way out; a D of its own for each would turn a wrist, whose lever is short, as
        fast as a shoulder, to no use, and it chatters where a point changes from link to link. M_j/D is b = 0.3 of the
        time v_j/a_j that a joint needs to its largest speed: the filter smooths, the acceleration limits set the pace.
        M = 4, D = 20 of the first experiment are what s = 1/4, b = 0.6 give on the IRB 140; its own are 1 and 10.

        A slow axis, as a rail or a lift under the arm, must not make all joints as slow: the maximum is over those that
        need at most `SLOW` times the D of the joint that moves the wire fastest, at ℓ_j v_j; half of that if it slides:
        it moves all links whole, but one way only. The others, of which the bundled robots have none, have the larger
        D_j = Δ ℓ_j/(s v_j) that they need, and M_j = D_j b v_j/a_j.

        The friction of a joint is c_j = `RESTING` Δ ℓ_j: half that danger at one point at rest turns nothing.

        Stability: moving away reduces the force, K = -∂σ/∂q >= 0, and (M s + D) q̇0 = σ is passive for whatever positive
        M and D, also diagonal ones: a point at rest is evaded without a cycle whatever K is. A delay T takes phase from
        that: where the loop's gain K/(ω |M jω + D|) is 1, it needs ω T + atan(ω M/D) < π/2, with diagonal ones for the
        largest M_j/D_j; a larger D_j of some joints only lowers the gain, as D^-½ K D^-½ falls. At the distance d a
        danger Δ falls as Δ/d, so K <= Δ Σ_j ℓ_j²/(2 d), with all joints at their longest levers. For the IRB 140 at
        0.3 m K/D <= 11 rad/s, the gain is 1 at 8 rad/s, and T = 0.02 s, M/D = 0.1 s take 9° and 39° of 90°.

        Args:
            robot: The robot.
            dt: Sample time [s].
        """
        from qpsafe.danger.thresholds import robot_thresholds

        high, lever = robot_thresholds(robot)[0], levers(robot)
        friction = friction_of(robot, high)
        if robot.tuned.evasion is not None:
            M, D, c = robot.tuned.evasion
            return cls(M, D, robot.nq, dt, friction if c is None else c)
        needed = high.start * lever / (SPEED_SHARE * robot.max_velocity)
        speed = lever * robot.max_velocity * np.where(robot.sliding, 0.5, 1.0)
        common = needed <= SLOW * needed[int(np.argmax(speed))]
        damping = np.where(common, needed[common].max(), needed)
        mass = damping * TIME_SHARE * robot.max_velocity / robot.max_acceleration
        return cls(mass, damping, robot.nq, dt, friction)

    @property
    def mass(self) -> NDArray[np.float64]:
        """M (n, n), read-only."""
        return self._mass

    @property
    def damping(self) -> NDArray[np.float64]:
        """D (n, n), read-only."""
        return self._damping

    @property
    def friction(self) -> NDArray[np.float64]:
        """c (n,) [N m], read-only."""
        return self._friction

    @property
    def drop(self) -> NDArray[np.float64]:
        """What friction takes from the joints' speeds in a step where nobody comes (n,) [rad/s], read-only."""
        return self._drop

    @property
    def dt(self) -> float:
        """Sample time [s]."""
        return self._dt

    @property
    def velocity(self) -> NDArray[np.float64]:
        """q̇0 (n,) [rad/s] of the last step, which the next one goes on from; another one is copied."""
        return self._velocity

    @velocity.setter
    def velocity(self, velocity: ArrayLike) -> None:
        self._velocity = self._vector("velocity", velocity)

    def step(self, sigma: NDArray[np.float64], coming: float = inf) -> NDArray[np.float64]:
        """Advance one sample under the virtual torque σ (n,) and return the evasive velocity q̇0 (n,) [rad/s].

        Args:
            sigma: σ [N m].
            coming: How fast the fastest point comes nearer [m/s]; infinite where that is not known: no friction.

        Raises:
            ConfigurationError: σ is not n finite numbers, or coming is no speed.
        """
        velocity = np.empty(len(self._velocity))
        sigma, coming = self._vector("sigma", sigma), _speed(coming)
        filter_by(self._A, self._B, self._velocity, sigma, velocity)
        rub(velocity, self._drop, coming)
        self._velocity = velocity
        return velocity

    def remember(self, velocity: NDArray[np.float64]) -> None:
        """Take what compiled code has computed for a step (n,) [rad/s], finite."""
        self._velocity = velocity.copy()

    def _vector(self, key: str, value: ArrayLike) -> NDArray[np.float64]:
        """A copy as n finite numbers; compiled code does not look at sizes."""
        shape = self._velocity.shape
        try:
            vector = np.array(value, dtype=float)
        except (TypeError, ValueError):
            vector = np.full(shape, np.nan)
        if vector.shape != shape or not np.isfinite(vector).all():
            raise ConfigurationError("Evasion", key, value, f"{shape[0]} finite numbers")
        return vector

    @property
    def matrices(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """A, B (n, n) of a step, q̇0 <- A q̇0 + B σ."""
        return self._A, self._B

    def reset(self) -> None:
        """Forget the past: q̇0 = 0."""
        self._velocity = np.zeros_like(self._velocity)


def evade(evasion: Evasion, sigma: NDArray[np.float64], coming: float) -> NDArray[np.float64]:
    """One step of an evasion that is asked; of one without friction, whose `step` may know nothing of who comes.

    Args:
        evasion: Any, maybe of a derived class.
        sigma, coming: See `Evasion.step`.
    """
    return evasion.step(sigma, coming) if evasion.friction.any() else evasion.step(sigma)


def _speed(value: float) -> float:
    return value if value == inf else number("Evasion", "coming", value, "a speed >= 0 [m/s]", 0.0)


def _not_negative(value: ArrayLike, n: int, key: str) -> NDArray[np.float64]:
    """Scalar or (n,) as n checked numbers."""
    expected = f"a number >= 0 [N m], or ({n},) of them"
    array = numbers("Evasion", key, value, expected)
    if array.shape not in ((), (1,), (n,)) or not (np.isfinite(array).all() and (array >= 0.0).all()):
        raise ConfigurationError("Evasion", key, value, expected)
    return np.array(np.broadcast_to(array, n), dtype=float)


def friction_of(robot: Robot, high: Threshold) -> NDArray[np.float64]:
    """The rule's friction c (n,) [N m], see `Evasion.for_robot`.

    Args:
        robot: The robot.
        high: Where its most important task is released.
    """
    return RESTING * high.start * levers(robot)


def _positive_definite(value: ArrayLike, n: int, key: str) -> NDArray[np.float64]:
    """Scalar, diagonal or full matrix as a checked (n, n) symmetric positive definite array."""
    expected = f"a positive scalar, ({n},) positive diagonal or ({n}, {n}) symmetric positive definite matrix"
    array = numbers("Evasion", key, value, expected)
    if array.ndim < 2 and array.shape in ((), (1,), (n,)):
        array = np.diag(np.broadcast_to(array, n).astype(float))
    if array.shape != (n, n) or not np.isfinite(array).all() or not np.allclose(array, array.T):
        raise ConfigurationError("Evasion", key, value, expected)
    if np.linalg.eigvalsh(array)[0] <= 0.0:
        raise ConfigurationError("Evasion", key, value, expected)
    return array
