"""Whatever a law, a task or a trajectory does, the tick reports it and the limits hold."""

from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from amounts import crossed, first, thinned

import qpsafe
from qpsafe.laws.problem import LawProblem, LawResult
from qpsafe.tasks.trajectory import Sample

N = 6
Answer = Callable[[LawProblem], Any]


class Law:
    """The paper's law, but for some ticks, in which it answers something else."""

    def __init__(self, answer: Answer) -> None:
        self.answer = answer
        self.spoilt = False
        self.law = qpsafe.NullspaceLaw()

    def solve(self, problem: LawProblem) -> Any:
        return self.answer(problem) if self.spoilt else self.law.solve(problem)


def raising(error: BaseException) -> Answer:
    def answer(problem: LawProblem) -> Any:
        raise error

    return answer


FAULTY: dict[str, tuple[Answer, str]] = {
    "raises": (raising(RuntimeError("no licence")), "RuntimeError: no licence"),
    "asserts": (raising(AssertionError()), "AssertionError"),
    "linear algebra": (raising(np.linalg.LinAlgError("SVD did not converge")), "LinAlgError: SVD"),
    "out of memory": (raising(MemoryError()), "MemoryError"),
    "recursion": (lambda problem: FAULTY["recursion"][0](problem), "RecursionError"),
    "None": (lambda _: None, "NoneType, expected a LawResult"),
    "bare array": (lambda p: p.qd0, "ndarray, expected a LawResult"),
    "look-alike": (lambda p: SimpleNamespace(qd=p.qd0, status="solved"), "SimpleNamespace, expected a LawResult"),
    "NaN": (lambda _: LawResult(np.full(N, np.nan)), "not finite"),
    "absurd": (lambda _: LawResult(np.full(N, -1e6)), "absurd"),
    "largest float": (lambda _: LawResult(np.full(N, np.finfo(float).max)), "absurd"),
    "one NaN": (lambda p: LawResult(np.where(np.arange(N) == 3, np.nan, p.qd0)), "not finite"),
    "+inf": (lambda _: LawResult(np.full(N, np.inf)), "not finite"),
    "-inf": (lambda _: LawResult(np.full(N, -np.inf)), "not finite"),
    "short": (lambda p: LawResult(p.qd0[1:]), r"shape \(5,\)"),
    "one for all": (lambda _: LawResult(np.zeros(1)), r"shape \(1,\)"),
    "scalar": (lambda _: LawResult(np.float64(0.1)), r"shape \(\)"),
    "number": (lambda _: LawResult(0.1), r"shape \(\)"),  # type: ignore[arg-type]
    "row": (lambda p: LawResult(p.qd0[None, :]), r"shape \(1, 6\)"),
    "column": (lambda p: LawResult(p.qd0[:, None]), r"shape \(6, 1\)"),
    "two answers": (lambda p: LawResult(np.vstack((p.qd0, p.qd0))), r"shape \(2, 6\)"),
    "nothing": (lambda _: LawResult(None), "object"),  # type: ignore[arg-type]
    "text": (lambda _: LawResult(np.array(["0"] * N)), "<U1"),
    "complex": (lambda p: LawResult(p.qd0 + 0j), "complex128"),
    "masked": (lambda p: LawResult(np.ma.masked_array(p.qd0, p.qd0 == p.qd0[0])), "masked"),
}


@pytest.mark.parametrize(("key", "limits"), crossed(FAULTY, ["robot", "off"]))
def test_a_faulty_law_is_reported_and_the_robot_brakes(run: Any, key: str, limits: str) -> None:
    answer, words = FAULTY[key]
    law = Law(answer)
    loop = run(law, limits=limits)
    loop.stir(12)
    law.spoilt = True
    tick = loop.settle(18, loop.q, loop.qd, points=[])
    assert tick.status == "fault"
    with pytest.raises(AssertionError, match=words):  # the message holds the words
        raise AssertionError(tick.messages[0])
    assert tick.law is None
    assert str(tick)

    law.spoilt = False
    assert loop.step().status in ("ok", "degraded")
    for _ in range(6):
        loop.step()
    assert loop.qd.any()


def test_the_path_waits_for_a_robot_that_a_fault_holds(run: Any) -> None:
    """Both on the path and on the way back to it; else the robot would have to catch up with a reference far ahead."""
    law = Law(raising(RuntimeError()))
    loop = run(law, recovery=qpsafe.RecoveryRules(dwell=0.0))
    for _ in range(5):
        loop.step()
    for phase in ("following", "recovering"):
        law.spoilt = False
        if phase == "recovering":
            loop.stir(30)
            for _ in range(5):
                loop.step()
        assert loop.controller.recovery.phase == phase
        clocks = loop.controller.recovery.clocks
        assert clocks[0] > 0.0
        law.spoilt = True
        for _ in range(200):
            assert loop.step().status == "fault"
        assert loop.controller.recovery.clocks == clocks


@pytest.mark.parametrize("size", first(1, [5.0, 1e5]))
def test_a_law_beyond_the_limits_is_clipped_and_named(run: Any, size: float) -> None:
    """Every joint is driven against its position limit, at the largest speed and acceleration there is."""
    push = np.array([1.0, -1.0, 1.0, -1.0, 1.0, -1.0]) * size
    law = Law(lambda _: LawResult(push.copy()))
    law.spoilt = True
    loop = run(law)
    fastest = np.zeros(N)
    for _ in range(700):
        tick = loop.step()  # `loop` watches
        assert tick.status == "degraded"
        assert "the law exceeded the limits, clipped: joint_1" in tick.messages[-1]
        fastest = np.maximum(fastest, np.abs(tick.reference.qd))
    end = np.where(push > 0, loop.robot.upper, loop.robot.lower)
    assert loop.q == pytest.approx(end, abs=1e-6)
    assert fastest[:2] == pytest.approx(loop.robot.max_velocity[:2])  # the others have less way to go
    assert np.abs(loop.qd).max() < 1e-6
    law.answer = lambda _: LawResult(-push)
    for _ in range(200):
        loop.step()


def test_a_law_of_whole_numbers_is_no_fault(run: Any) -> None:
    law = Law(lambda _: LawResult(np.zeros(N, dtype=np.int64)))
    law.spoilt = True
    assert run(law).step().status == "ok"


def test_without_limits_the_reference_stays_finite(run: Any) -> None:
    """`loop` asserts that, and that every reference is one step from the last; measured, the robot stands still."""
    for size in (1e2, 2e5, 1e308):
        law = Law(lambda _, size=size: LawResult(np.full(N, size)))
        law.spoilt = True
        loop = run(law, limits="off")
        for _ in range(300):
            tick = loop.feed(loop.robot.home, np.zeros(N), points=[])
            assert tick.status == ("fault" if size > 1e300 else "ok")
        loop.feed(None, None)


@pytest.mark.parametrize("limits", ["robot", "off"])
def test_a_law_that_writes_into_what_it_was_given_changes_nothing(run: Any, limits: str) -> None:
    kept: list[np.ndarray] = []

    def vandal(problem: LawProblem) -> LawResult:
        answer = qpsafe.NullspaceLaw().solve(problem)
        for array in (problem.qd0, problem.lower, problem.upper, *(a for task in problem.tasks for a in task)):
            if array is not None:
                array[...] = 1e9
        kept.append(answer.qd)
        for old in kept:
            old[...] = np.nan if old is not answer.qd else old
        return answer

    law = Law(vandal)
    law.spoilt = True
    spoilt, clean = run(law, limits=limits), run(qpsafe.NullspaceLaw(), limits=limits)
    tip = spoilt.robot.pose("tcp", spoilt.q)[:3, 3]
    for k in range(60):
        point = tip[None] + [0.15 + 0.002 * k, 0.02, 0.0]
        assert np.array_equal(spoilt.step(point).reference.qd, clean.step(point).reference.qd)
    kept[-1][...] = np.nan
    assert np.array_equal(spoilt.feed(None, None).reference.qd, clean.feed(None, None).reference.qd)


def test_a_tick_keeps_the_answer_of_a_law_that_uses_its_array_again(run: Any) -> None:
    memory = np.zeros(N)

    def again(problem: LawProblem) -> LawResult:
        memory[:] = qpsafe.NullspaceLaw().solve(problem).qd
        return LawResult(memory)

    law = Law(again)
    law.spoilt = True
    loop, ticks, seen = run(law), [], []
    tip = loop.robot.pose("tcp", loop.q)[:3, 3]
    for k in range(30):
        ticks.append(loop.step(tip[None] + [0.15 + 0.002 * k, 0.02, 0.0]))
        seen.append(ticks[-1].law.qd.copy())
    assert np.ptp(seen, axis=0).max() > 0.01
    assert np.array_equal([tick.law.qd for tick in ticks], seen)


def test_what_is_no_exception_passes_through(run: Any) -> None:
    """Ctrl-C must still stop the program."""
    law = Law(raising(KeyboardInterrupt()))
    law.spoilt = True
    with pytest.raises(KeyboardInterrupt):
        run(law).step()


def test_a_law_that_is_not_solved_is_degraded(run: Any) -> None:
    law = Law(lambda _: LawResult(np.zeros(N), status="stopped early"))
    law.spoilt = True
    tick = run(law).step()
    assert (tick.status, tick.messages) == ("degraded", ("law: stopped early",))


class Path:
    """At home, but answers something else at every `period`-th sample once armed."""

    def __init__(self, pose: np.ndarray, answer: Callable[[], Sample], period: int) -> None:
        self.pose, self.answer, self.period = pose, answer, period
        self.count, self.armed = 0, False

    def sample(self, t: float) -> Sample:
        self.count += 1
        if self.armed and (self.count * 7919 // 64) % self.period == 0:  # any task, any call of a tick
            return self.answer()
        return Sample(self.pose, np.zeros(6))


def fail() -> Sample:
    raise ValueError("no such time")


@pytest.mark.parametrize("period", thinned(2, range(1, 6)))
@pytest.mark.parametrize(
    "answer",
    [
        fail,
        lambda: Sample(np.full((4, 4), np.nan), np.zeros(6)),
        lambda: Sample(np.eye(4), np.full(6, np.inf)),
        lambda: Sample(np.eye(3), np.zeros(6)),
        lambda: Sample(np.eye(4), np.zeros(3)),
        lambda: None,
    ],
    ids=["raises", "NaN pose", "infinite twist", "3 x 3 pose", "short twist", "None"],
)
def test_a_faulty_trajectory_never_moves_the_robot_twice_in_a_tick(
    run: Any, irb140: Any, answer: Callable[[], Sample], period: int
) -> None:
    """Wherever in the tick it fails: `loop` checks that each reference is one step from the last."""
    path = Path(irb140.pose("tcp", irb140.home), answer, period)
    loop = run(qpsafe.NullspaceLaw(), tasks=[qpsafe.PositionTask("tcp", path), qpsafe.OrientationTask("tcp", path)])
    loop.stir(14)
    path.armed = True
    statuses = {loop.step().status for _ in range(40)}
    assert statuses & {"fault", "degraded"}
    path.armed = False
    assert loop.step().status in ("ok", "degraded")


def test_a_robot_outside_its_limits_comes_back(run: Any, irb140: Any) -> None:
    """Each joint starts up to 3 degrees outside, at either side, while the law pushes further out."""
    for side in (-1.0, 1.0):
        limit = irb140.upper if side > 0 else irb140.lower
        outside = np.deg2rad([3.0, 0.1, 1.0, 2.0, 0.5, 3.0])
        law = Law(lambda _, side=side: LawResult(np.full(N, 50.0 * side)))
        law.spoilt = True
        loop = run(law, q=limit + side * outside, gate="off", clearance="off")  # no robot can fold up like that
        first = loop.step()
        assert first.status == "degraded"
        for name in irb140.joint_names:
            assert f"{name}: position limit sacrificed" in first.messages
        for _ in range(250):
            loop.step()
            beyond = side * (loop.q - limit) > 1e-9
            assert (side * loop.qd[beyond] <= 1e-12).all()  # never further out
        assert loop.all_inside
        assert loop.q == pytest.approx(limit, abs=1e-9)  # the law still pushes
        tick = loop.step()
        assert not any("sacrificed" in message for message in tick.messages)


def test_outside_the_limits_bad_data_stop_the_robot_all_the_same(run: Any, irb140: Any) -> None:
    loop = run(q=irb140.upper + 0.1, gate="off", clearance="off")
    for _ in range(10):
        loop.step()
    assert loop.qd.any()
    loop.settle(20, np.full(N, np.nan), np.zeros(N), points=[])
    for _ in range(350):
        loop.step()
    assert loop.all_inside
