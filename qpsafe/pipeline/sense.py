"""The first half of a tick: from what was measured to the danger and the velocity that evades it.

    distances --(7), sensing rules--> points --(1)-(6)--> danger vectors --(8), (14), (15)--> torque --(16)--> q̇0
    images --sensing rules, the most dangerous of each link and sensor--^

One compiled call, see `qpsafe.pipeline.sense_kernel`. A field or an evasion of another making takes the place of its
stage; the stages before it stay the compiled ones.
"""

from __future__ import annotations

from math import inf, isfinite, nan
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from qpsafe.danger.evasion import Evasion, evade
from qpsafe.danger.field import DangerField
from qpsafe.danger.push import push_vectors
from qpsafe.gate.gated import NO_AGES
from qpsafe.pipeline.sense_kernel import (
    bodies_and_wire,
    pack,
    sense_points,
    sense_readings,
    stand,
    work_size,
)
from qpsafe.ranging.ranged import COLUMNS, PERSON, Ranged
from qpsafe.robot.wire import Wire
from qpsafe.sensing.detection import (
    BadInput,
    as_floats,
    as_joint_position,
    as_joint_velocity,
    as_points,
    plausible,
    reals,
    refuse,
    refuse_points,
)
from qpsafe.sensing.health import CLEAR
from qpsafe.sensing.sensing import DistanceSensing
from qpsafe.sensing.velocity import unsettled

if TYPE_CHECKING:
    from qpsafe.ranging.ranging import RangeSensing
    from qpsafe.robot.robot import Robot

Array = NDArray[np.float64]


CLOUD = 1_000  # more points are reduced, see `qpsafe.ranging.reduction.cloud`
_NOBODY, _NOWHERE = np.empty((0, 3)), np.empty(0, dtype=np.int64)


class Seen(NamedTuple):
    """What a tick knows of the danger.

    Attributes:
        points: Points that count (p, 3), world frame [m].
        links: Wire link of each (p,).
        danger: CDF at them (p,).
        vectors: Danger vectors (6) at them (p, 3).
        cdf_n: The largest danger.
        qd0: Evasive velocity q̇0 (n,) [rad/s].
        notes: What is wrong with the sensors, in words.
        capped: Whether the robot has to go slowly, since a sensor is dead.
        near: What images show near the robot, where it was seen, counted above or not (e, 3) [m].
        leads: For how long before now somebody could have come from there (e,) [s].
    """

    points: Array
    links: NDArray[np.int64]
    danger: Array
    vectors: Array
    cdf_n: float
    qd0: Array
    notes: tuple[str, ...] = ()
    capped: bool = False
    near: Array = _NOBODY
    leads: Array = NO_AGES

    @property
    def people(self) -> Array:
        """Where somebody was seen: by spots, or as points given, then by images (p + e, 3) [m]."""
        return self.points if not len(self.near) else np.concatenate((self.points, self.near))


class Sense:
    """Senses ticks with one set of parts; parts do not change, whoever exchanges one makes another `Sense`.

    Args:
        robot: The robot.
        sensing: Its distance sensors, or None.
        field: The danger field.
        evasion: The admittance.
        ranging: Its sensors of many zones, or None.
    """

    def __init__(
        self, robot: Robot, sensing: DistanceSensing | None, field: Any, evasion: Evasion,
        ranging: RangeSensing | None = None,
    ) -> None:  # fmt: skip
        self.parts, self._ranging = (sensing, field, evasion, ranging), ranging
        self._more = 0 if ranging is None else ranging.room
        self._robot, self._shape = robot, (robot.nq,)
        self._ours = type(field) is DangerField, type(evasion) is Evasion
        tables = {} if sensing is None else sensing.tables._asdict()
        starts, stops = robot.wire_indices
        self._all_ours = ours = all(self._ours)
        given = (
            tables | robot.tree._asdict() | {"plausible": np.array(plausible(robot)), "starts": starts, "stops": stops}
        )
        given["weights"] = (field.static, field.kinetic, field.gamma, field.floor) if ours else (nan,) * 4
        given["A"], given["B"] = evasion.matrices if ours else np.zeros((2, robot.nq, robot.nq))
        sensors = [part.rules for part in (sensing,) if part] + [part.sensing for part in (ranging,) if part]
        self._speeds = all(rules.velocities for rules in sensors)  # else nobody knows who comes: no friction
        if ranging is not None:  # nor where images are not tracked, or a user's field is shown them at rest
            self._speeds = self._speeds and ranging.rules.predict and self._ours[0]
        given["drop"] = evasion.drop if ours and self._speeds else np.zeros(robot.nq)
        counts = [len(tables.get(key, ())) for key in ("bodies", "balls", "planes")]
        self._still = np.zeros(robot.nq)
        self._sizes = (robot.nq, robot.ends, len(starts), *counts, robot.memory)
        self.blocks = pack(self._sizes, given, given)
        self._work = np.empty(work_size(self._sizes, counts[0] + self._more))
        self._stood = bodies_and_wire(self._sizes, self._work)

    def __call__(
        self, q: ArrayLike, qd: ArrayLike, distances: ArrayLike | None, points: ArrayLike | None,
        ages: ArrayLike | None, images: Any = None, now: float = 0.0, person: float = PERSON,
    ) -> Seen:  # fmt: skip
        """Sense one tick; arguments as for `SafetyController.step`, and how fast people come [m/s].

        Images are in the inbox already, whatever else is wrong with a tick.

        Raises:
            BadInput: Wrong shapes, or values that are no measurement; too many sensors out of order; a point, or its
                danger, that is not finite; both or neither of distances and points: silence is not safety, "nothing in
                sight" is said by distances of +inf or an empty list of points.
        """
        if distances is not None and points is not None:
            raise BadInput("both distances and points are given, expected one of them")
        q, qd = as_floats("q", q), as_floats("qd", qd)
        if not q.shape == qd.shape == self._shape:
            refuse(q, qd, self._robot)
        more = _NO_MORE
        if self._ranging is not None:
            if not stand(q, qd, *self.blocks, self._work):
                refuse(q, qd, self._robot)
            more = self._ranging.update((), now, q, *self._stood, self.parts[1], person)
            if distances is None and points is None and self.parts[0] is None:
                points = _NOBODY
        elif images is not None:
            raise BadInput("images are given but the controller has no range_sensors")
        if points is None and distances is not None:
            distances = as_floats("distances", distances)
            if not (distances.ndim == 2 and distances.shape[1] == 3):
                return self._by_distances(q, qd, distances, ages, more)
            points = distances
        if points is None:
            raise BadInput("neither distances nor points are given; where nothing is in sight, say points=[]")
        return self._by_points(q, qd, points, ages, more)

    def _by_distances(self, q: Array, qd: Array, distances: Array, ages: ArrayLike | None, more: Ranged) -> Seen:
        sensing = self.parts[0]
        if sensing is None:
            raise BadInput("distances are given but the robot has no spots")
        k = len(sensing.fresh)
        if distances.shape != (k,):
            raise BadInput(f"distances have shape {distances.shape}, expected {(k,)}")
        p = k + len(more.points)
        points, links, danger, vectors = np.empty((p, 3)), np.empty(p, np.int64), np.empty(p), np.empty((p, 3))
        qd0 = np.empty(len(q))
        count, dead, out, cdf_n = sense_readings(
            q, qd, distances, sensing.as_ages(ages), *more[:2], *self.blocks, *sensing.memory, self._before, self._work,
            points, links, danger, vectors, qd0,
        )  # fmt: skip
        if count < 0:
            refuse(q, qd, self._robot)
        severity, too_many, notes = sensing.take(dead, out)
        if too_many:
            raise BadInput("; ".join(notes))
        capped = severity != CLEAR
        if self._ranging is not None:
            capped, notes = self._with(capped, notes, more, sensing.unseen)
        seen = tuple.__new__(Seen, (  # without a detour through Python
            points[:count], links[:count], danger[:count], vectors[:count], cdf_n, qd0, notes, capped, more.near,
            more.leads,
        ))  # fmt: skip
        return self._ended(seen, self._work, count if sensing.rules.velocities else 0, self._speeds, sensing.memory[-1])

    def _by_points(self, q: Array, qd: Array, value: ArrayLike, ages: ArrayLike | None, more: Ranged) -> Seen:
        if ages is not None:  # old points would count as seen now
            raise BadInput("ages are given with points, which have none: leave out points that are too old")
        given, notes = as_points(value), tuple[str, ...]()
        if len(given) > CLOUD:
            given, notes = self._reduced(q, qd, given)
        p = len(given) + len(more.points)
        points, links, danger, vectors = np.empty((p, 3)), np.empty(p, np.int64), np.empty(p), np.empty((p, 3))
        qd0, work = np.empty(len(q)), np.empty(work_size(self._sizes, p))
        count, cdf_n = sense_points(
            q, qd, given, *more[:2], *self.blocks, self._before, work, points, links, danger, vectors, qd0
        )  # fmt: skip
        if count == -1:
            refuse(q, qd, self._robot)
        if count < 0:
            refuse_points(points)
        capped = False
        if self._ranging is not None:
            capped, notes = self._with(capped, notes, more)
        seen = Seen(points, links, danger, vectors, cdf_n, qd0, notes, capped, *more[2:4])
        return self._ended(seen, work, p if len(more.points) else 0, self._speeds and not len(given))

    def _reduced(self, q: Array, qd: Array, given: Array) -> tuple[Array, tuple[str, ...]]:
        """The points of a cloud that count, and that it was reduced."""
        from qpsafe.ranging.reduction.cloud import check_size, reduced, reduction  # compiled when it is asked for

        check_size(given)
        wire = self._robot.at(as_joint_position(q, self._robot)).wire(as_joint_velocity(qd, self._robot))
        kept = reduced(given, wire)
        return kept, (reduction(len(given), len(kept)),)

    def _with(
        self, capped: bool, notes: tuple[str, ...], more: Ranged, spots: tuple[str, ...] = ()
    ) -> tuple[bool, tuple[str, ...]]:
        """Whether the robot has to go slowly, and what is wrong, with what images tell beside their points.

        Args:
            capped: By the spots alone.
            notes: Likewise.
            more: Of the images.
            spots: That do not see, if their readings are given.

        Raises:
            BadInput: With the spots too many sensors do not see.
        """
        assert self._ranging is not None
        notes = (*notes, *more.notes) if more.notes else notes
        watches = self._ranging.watches
        out = len(spots) + len(watches.unseen) if spots else 0  # either kind alone has been counted
        if out > watches.most:
            more_than = f"more than {watches.most} of all sensors do not see: stopped until they do"
            raise BadInput("; ".join((more_than, *notes)))
        return capped or watches.severity != CLEAR, notes

    @property
    def _before(self) -> Array:
        """q̇0 of the last tick (n,) [rad/s], where the compiled call needs it."""
        return self.parts[2].velocity if self._ours[1] else self._still

    def _ended(self, seen: Seen, work: Array, moving: int, known: bool, track: Array | None = None) -> Seen:
        """What is left to do: the stages of another making, and to remember q̇0.

        Args:
            seen: By the compiled call.
            work: In which it worked; it holds the points' velocities.
            moving: How many of these.
            known: Whether it is known how fast every point moves.
            track: Which spots know it, see `unsettled`; None without their readings.
        """
        _, field, evasion, _ = self.parts
        if not self._all_ours:
            seen = self._asked(seen, field, evasion, work, moving, known, track)
        elif not isfinite(seen.cdf_n):  # never into the filter, which remembers
            raise BadInput(_NOT_FINITE)
        else:
            evasion.remember(seen.qd0)
        return seen

    def _asked(
        self, seen: Seen, field: Any, evasion: Evasion, work: Array, moving: int, known: bool, track: Array | None
    ) -> Seen:  # fmt: skip
        """Danger and q̇0 by a field and an evasion that are asked method by method; arguments as for `_ended`."""
        n, m, memory = len(seen.qd0), len(self._robot.wire_frames), self._robot.memory
        a = memory + 12 * m
        wire = Wire(*work[memory:a].reshape(4, m, 3).copy())
        velocities = work[a + n : a + n + 3 * moving].reshape(moving, 3).copy() if moving else None
        values, gradient = field.evaluate(seen.points, wire, velocities)  # (1)-(5)
        torque, danger = np.empty(n), reals("the field's value", values, seen.danger.shape).copy()
        vectors = np.array(reals("the field's gradient", gradient, seen.points.shape), order="C")
        cdf_n = push_vectors(  # (6), (8), (14), (15)
            danger, seen.links, work[:memory], self._robot.ends, *self._robot.wire_indices, vectors, torque
        )
        if not isfinite(cdf_n):
            raise BadInput(_NOT_FINITE)
        fastest = float(np.linalg.norm(velocities, axis=1).max()) if velocities is not None else 0.0
        coming = fastest if known and not (track is not None and unsettled(track)) else inf
        qd0 = reals("the evasion's velocity", evade(evasion, torque, coming), torque.shape).copy()  # (16)
        if not np.isfinite(qd0).all():
            raise ValueError(f"the evasion's velocity is not finite: {qd0}")
        return seen._replace(danger=danger, vectors=vectors, cdf_n=cdf_n, qd0=qd0)


_NO_MORE = Ranged(np.empty((0, COLUMNS)), _NOWHERE, _NOBODY, NO_AGES)
_NOT_FINITE = "the danger of a detected point is not finite: joint values or points are out of all bounds"
