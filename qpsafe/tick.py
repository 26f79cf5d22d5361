"""One tick that explains itself: what was seen, how dangerous it is, what gave way and what was commanded."""

from __future__ import annotations

from dataclasses import dataclass, field, fields

import numpy as np
from numpy.typing import NDArray

from qpsafe.danger.separation_limit import SeparationLevel
from qpsafe.gate.gated import PASSED, Gated
from qpsafe.geometry.clearance_level import ClearanceLevel
from qpsafe.laws.problem import LawResult
from qpsafe.limits import Box
from qpsafe.pipeline.resolved import Resolved
from qpsafe.reference import JointReference, same
from qpsafe.tasks.errors import TaskErrors
from qpsafe.text.words import counted

#: The tick went as planned.
OK = "ok"
#: The law answered, but not as planned (limits sacrificed, a solver failed); `messages` says how.
DEGRADED = "degraded"
#: The input could not be used; the robot holds, braking within its limits.
BAD_INPUT = "bad_input"
#: Something in the controller failed; the robot holds, braking within its limits.
FAULT = "fault"


def _no_vectors() -> NDArray[np.float64]:
    return np.zeros((0, 3))


@dataclass(slots=True, eq=False, repr=False)
class Tick:
    """Result of `SafetyController.step`.

    Two ticks are equal if they say the same, NaN included, however long they took. A tick can be copied, pickled, and
    changed by `dataclasses.replace`.

    Attributes:
        reference: Joint references for the robot.
        cdf_n: CDF_n, the largest danger over the detected points; 0 without detection, NaN if it could not be told.
        m: Switch (19) of the task of highest priority.
        f: Switch (21) of the task below it; 1 if there is none.
        activations: a_1..a_N of the tasks (m, m f).
        regime: ``low``, ``medium`` or ``high`` danger, Table I; ``unknown`` if the input was bad.
        phase: ``following``, ``suspended`` or ``recovering``, section IV-C.
        status: ``ok``, ``degraded``, ``bad_input`` or ``fault``.
        messages: What was unusual, in words.
        solve_time: Wall time of the whole tick [s].
        qd0: Evasive velocity q̇0 (n,) [rad/s].
        points: Detected points that counted, (p, 3), world frame [m].
        links: Wire link that each point belongs to, (p,), from 0.
        vectors: Danger vectors (6) at the points, (p, 3).
        near: What range sensors saw near the robot, where they saw it, counted among the points or not (e, 3) [m].
        path_time: Clock of the tasks' trajectories [s].
        events: Names of the events that the tasks' programs reached at this tick, e.g. ``grip``.
        waits_for: Names of the tasks that the path waits for: in ``recovering``, or with an event due.
        severity: Of sick sensors, until acknowledged: ``clear``, ``capped`` (speed) or ``stopped``.
        unseen: Names of the spots that cannot be trusted now, sick or in another unit than metres: nobody knows what is
            in front of them.
        joint_names: (n,) names used in reports.
        task_names: Likewise, one per task.
        gate: What the last step, verified motion, let through of the command, and what was in its way.
        resolved: Results of tasks, limits and law; None if they were not asked.
        off_path: The `errors` where the references of this tick were not the tasks' own trajectories.
    """

    reference: JointReference
    cdf_n: float
    m: float
    f: float
    activations: tuple[float, ...]
    regime: str
    phase: str
    status: str
    messages: tuple[str, ...] = ()
    solve_time: float = 0.0
    qd0: NDArray[np.float64] = field(default_factory=lambda: np.zeros(0))
    points: NDArray[np.float64] = field(default_factory=_no_vectors)
    links: NDArray[np.int64] = field(default_factory=lambda: np.zeros(0, dtype=np.int64))
    vectors: NDArray[np.float64] = field(default_factory=_no_vectors)
    near: NDArray[np.float64] = field(default_factory=_no_vectors)
    path_time: float = 0.0
    events: tuple[str, ...] = ()
    waits_for: tuple[str, ...] = ()
    severity: str = "clear"
    unseen: tuple[str, ...] = ()
    joint_names: tuple[str, ...] = ()
    task_names: tuple[str, ...] = ()
    gate: Gated = PASSED
    resolved: Resolved | None = None
    off_path: TaskErrors | None = None

    @property
    def errors(self) -> tuple[NDArray[np.float64], ...]:
        """Task errors of the commanded pose against the tasks' own trajectories, per task (rows,)."""
        if self.off_path is not None:
            return self.off_path.values
        return () if self.resolved is None else self.resolved.errors

    @property
    def box(self) -> Box | None:
        """Admissible joint velocities of this tick; None without limits."""
        return None if self.resolved is None else self.resolved.box

    @property
    def law(self) -> LawResult | None:
        """What the law answered, with the solution of every regime; None if it was not asked."""
        return None if self.resolved is None else self.resolved.result

    @property
    def binding(self) -> tuple[str, ...]:
        """Joint limits that the command touches, e.g. ``"joint_2: upper acceleration"``."""
        return () if self.box is None else self.box.binding(self.reference.qd, self.joint_names)

    @property
    def clearance(self) -> tuple[tuple[str, str, float], ...]:
        """Pairs of shapes that the command must not bring nearer to each other: their names and distance [m]."""
        levels = () if self.resolved is None else self.resolved.soft
        return tuple(x for rows in levels if isinstance(rows, ClearanceLevel) for x in rows.binding(self.reference.qd))

    @property
    def separation(self) -> tuple[tuple[str, int, float], ...]:
        """Parts of links that may not approach what is seen any faster: name, number of the point, distance [m]."""
        levels = () if self.resolved is None else self.resolved.soft
        return tuple(x for rows in levels if isinstance(rows, SeparationLevel) for x in rows.binding(self.reference.qd))

    @property
    def residuals(self) -> tuple[tuple[float, tuple[float, ...]], ...]:
        """Per regime solved: (weight, residual norm per level, the evasive level last)."""
        return () if self.law is None else tuple((w, solution.residuals) for w, solution in self.law.regimes)

    def explain(self) -> str:
        """The tick in words, several lines."""
        lines = [
            f"tick {self.reference.seq} at {self.reference.time:.3f} s: {self.status}, "
            f"{self.regime} danger, {self.phase}",
            f"  {counted(len(self.points), 'point')}, CDF_n = {self.cdf_n:.3f}, m = {self.m:.3f}, f = {self.f:.3f}",
        ]
        names = self.task_names or tuple(f"task {k + 1}" for k in range(len(self.activations)))
        for name, error, activation in zip(names, self.errors, self.activations, strict=False):
            lines.append(f"  {name}: activation {activation:.3f}, error norm {np.linalg.norm(error):.3g}")
        for weight, residuals in self.residuals:
            levels = ", ".join(f"{value:.3g}" for value in residuals)
            lines.append(f"  QP of weight {weight:.3f}: residual per level, highest priority first, {levels}")
        if self.waits_for:
            lines.append("  the path waits for: " + ", ".join(self.waits_for))
        if self.binding:
            lines.append("  binding: " + ", ".join(self.binding))
        if self.gate.cause:
            lines.append(f"  gate: {self.gate}")
        for one, other, gap in self.clearance:
            lines.append(f"  kept clear: {one} and {other}, {1e3 * gap:.1f} mm apart")
        for part, number, gap in self.separation:
            lines.append(f"  held apart: {part} and point {number}, {1e3 * gap:.1f} mm away")
        lines.extend("  note: " + message for message in self.messages)
        qd = np.array2string(self.reference.qd, precision=4, suppress_small=True)
        lines.append(f"  q̇ = {qd} rad/s in {1e6 * self.solve_time:.0f} µs")
        return "\n".join(lines)

    __str__ = explain

    def __repr__(self) -> str:
        words = f"{self.reference.seq}, {self.status}, {self.regime} danger, {self.phase}"
        return f"Tick({words}, cdf_n={self.cdf_n:.4g}, m={self.m:.4g}, f={self.f:.4g}, qd={self.reference.qd.round(4)})"

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Tick):
            return NotImplemented
        told = [part.name for part in fields(self) if part.name not in ("solve_time", "resolved", "off_path")]
        names = (*told, "errors", "box")
        return all(same(getattr(self, name), getattr(other, name)) for name in names)

    __hash__ = None  # type: ignore[assignment]  # holds arrays
