"""A recorded run once more: the controller is asked the same questions, and every answer compared bit by bit."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from qpsafe.sim.recording.run_file import CODE, PRINT, RunFile, RunFileError, fingerprint, versions
from qpsafe.sim.replay.settings import Experiment, experiment_of, loop_of
from qpsafe.tick import Tick

#: Called with every tick of a replay: its number and the tick.
Watcher = Callable[[int, Tick], None]


@dataclass(frozen=True)
class Difference:
    """Where a replay first differs.

    Attributes:
        tick: Its number, from 0.
        time: [s].
        what: Which answer: ``q_ref[0]``, ``qd_ref[2]``, ``cdf_n``, ``regime``, ``messages`` and so on.
        recorded, replayed: In words.
        largest: Largest difference of that answer at that tick, NaN where it is no number.
    """

    tick: int
    time: float
    what: str
    recorded: str
    replayed: str
    largest: float


@dataclass(frozen=True)
class Replay:
    """What a replay found.

    Attributes:
        ticks: Compared ones.
        different: Ticks in which any answer differs.
        first: The first of them; None if every bit is the same.
        largest: Largest difference of a commanded joint position in the whole run [rad].
        changed: What is not as it was when the run was recorded: versions, the robot's files.
    """

    ticks: int
    different: int
    first: Difference | None
    largest: float
    changed: tuple[str, ...]

    @property
    def same(self) -> bool:
        """Whether every bit is the same."""
        return self.first is None

    def to_dict(self) -> dict[str, Any]:
        """For JSON."""
        first = None if self.first is None else dict(vars(self.first))
        return {**vars(self), "first": first, "changed": list(self.changed), "same": self.same}


def replay(run: RunFile, watcher: Watcher | None = None, experiment: Experiment | None = None) -> Replay:
    """Replay a run.

    Args:
        run: From `read_run`.
        watcher: Called after every tick.
        experiment: The run's experiment if it has been built already.

    Raises:
        ConfigurationError: The recorded settings do not describe an experiment.
        RunFileError: The recorded inputs do not fit the robot.
    """
    experiment = experiment or experiment_of(run.header["settings"])
    loop, arrays = loop_of(experiment), run.arrays
    controller = loop.controller
    n, spots = experiment.robot.nq, len(run.header["spots"])
    for name, width in (("q", n), ("qd", n), ("q_ref", n), ("qd_ref", n), ("distances", spots)):
        if arrays[name].shape[1] != width:
            raise RunFileError(f"{run.path}: array {name!r} has {arrays[name].shape[1]} columns, expected {width}")
    messages, dt = run.messages(), controller.dt
    first: Difference | None = None
    different, largest = 0, 0.0
    for k in range(run.ticks):
        tick = loop.asked_again(k, arrays["q"][k], arrays["qd"][k], arrays["distances"][k])
        answers = _answers(tick)
        wrong = [name for name, value in answers.items() if not _equal(value, arrays[name][k])]
        if tick.messages != messages.get(k, ()):
            wrong.append("messages")
        if wrong:
            different += 1
            gap = np.abs(answers["q_ref"] - arrays["q_ref"][k]).max()
            largest = max(largest, float(gap))
            if first is None:
                first = _difference(k, k * dt, wrong[0], run, tick, messages.get(k, ()))
        if watcher is not None:
            watcher(k, tick)
    return Replay(run.ticks, different, first, largest, changed(run, experiment))


def changed(run: RunFile, experiment: Experiment) -> tuple[str, ...]:
    """What is not as it was when the run was recorded."""
    now = versions()
    found = [
        f"{name} {was} then, {now.get(name, 'not installed')} now"
        for name, was in run.header["versions"].items()
        if now.get(name) != was
    ]
    if CODE not in run.header["versions"]:
        found.append(f"the {CODE} was not noted then")
    was = run.header["robot_files"]
    if was.startswith(PRINT) and was != fingerprint(experiment.robot):
        found.append(f"the files of robot {experiment.robot.name} have changed")
    return tuple(found)


def _answers(tick: Tick) -> dict[str, Any]:
    return {
        "q_ref": tick.reference.q,
        "qd_ref": tick.reference.qd,
        "cdf_n": np.float64(tick.cdf_n),
        "m": np.float64(tick.m),
        "f": np.float64(tick.f),
        "regime": tick.regime,
        "phase": tick.phase,
        "status": tick.status,
    }


def _equal(a: Any, b: Any) -> bool:
    """Whether two words, or the bits of two arrays of floats, are the same; the sign of 0 and NaN count too."""
    if isinstance(a, str):
        return a == str(b)
    a, b = np.asarray(a), np.asarray(b)
    return a.shape == b.shape and bool(np.array_equal(_bits(a), _bits(b)))


def _bits(a: NDArray) -> NDArray[np.uint64]:
    return np.ascontiguousarray(a, dtype=np.float64).reshape(-1).view(np.uint64)


def _difference(k: int, time: float, what: str, run: RunFile, tick: Tick, messages: tuple[str, ...]) -> Difference:
    if what == "messages":
        return Difference(k, time, what, "; ".join(messages), "; ".join(tick.messages), float("nan"))
    a, b = run.arrays[what][k], _answers(tick)[what]
    if isinstance(b, str):
        return Difference(k, time, what, str(a), b, float("nan"))
    one, other = (np.atleast_1d(np.asarray(value, dtype=float)) for value in (a, b))
    gaps = np.where(one.view(np.int64) == other.view(np.int64), -1.0, np.abs(one - other))  # 0 and -0 differ by 0
    worst = int(np.argmax(gaps))
    recorded, replayed = np.atleast_1d(a)[worst], np.atleast_1d(b)[worst]
    name = f"{what}[{worst}]" if np.ndim(a) else what
    return Difference(k, time, name, repr(float(recorded)), repr(float(replayed)), float(abs(recorded - replayed)))
