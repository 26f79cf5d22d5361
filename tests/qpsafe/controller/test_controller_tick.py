"""A tick explains itself, and is the caller's own."""

import dataclasses
import re
from typing import Any

import numpy as np
import pytest

import qpsafe
from qpsafe.laws.problem import LawProblem, LawResult

N = 6


class Push:
    """A law that wants one velocity whatever the state."""

    def __init__(self, qd: Any, status: str = "solved") -> None:
        self.qd, self.status = np.array(qd, dtype=float), status

    def solve(self, problem: LawProblem) -> LawResult:
        return LawResult(self.qd, self.status)


def near(loop: Any, gap: float = 0.25) -> np.ndarray:
    return loop.robot.pose("tcp", loop.robot.home)[None, :3, 3] + [gap, 0.02, 0.05]


def ticks_of_every_status(run: Any) -> dict[str, qpsafe.Tick]:
    loop = run()
    return {
        "ok": loop.step(near(loop)),
        "degraded": run(Push([99.0] * N)).step(),
        "bad_input": loop.feed(None, None),
        "fault": run(Push([np.nan] * N)).step(),
        "first, bad": run().feed(None, None),
        "no limits": run(limits="off").step(near(loop)),
        "one task": run(tasks=run().tasks[:1]).step(near(loop)),
        "nullspace": run(qpsafe.NullspaceLaw()).step(near(loop)),
        "weighted": run(qpsafe.WeightedLaw()).step(near(loop)),
    }


def test_every_status_is_explained(run: Any) -> None:
    for key, tick in ticks_of_every_status(run).items():
        text = str(tick)
        assert text == tick.explain()
        assert tick.status in text
        assert tick.regime in text
        assert tick.phase in text
        assert all(message in text for message in tick.messages)
        assert len(text.splitlines()) >= 3
        if key in ("ok", "degraded", "bad_input", "fault"):
            assert tick.status == key
        assert repr(tick)


def test_an_explanation_says_what_gave_way(run: Any) -> None:
    loop = run()
    for _ in range(20):
        tick = loop.step(near(loop, 0.3))
    text = str(tick)
    assert f"CDF_n = {tick.cdf_n:.3f}" in text
    assert "  1 point, CDF_n" in text
    assert "position of tcp: activation" in text
    assert "orientation of tcp: activation" in text
    assert len(re.findall("QP of weight", text)) == len(tick.residuals) >= 1


@pytest.mark.parametrize(
    ("push", "ticks", "expected"),
    [
        ([99.0, -99.0, 0, 0, 0, 0], 1, ("joint_1: upper acceleration", "joint_2: lower acceleration")),
        ([99.0, 0, 0, 0, 0, 0], 120, ("joint_1: upper velocity",)),
        ([0, 0, 0, 0, 99.0, 0], 600, ("joint_5: upper position",)),
        ([0, -99.0, 0, 0, 0, 0], 900, ("joint_2: lower position",)),
        ([0.0] * N, 5, ()),
    ],
)
def test_binding_names_the_limit(run: Any, push: list[float], ticks: int, expected: tuple[str, ...]) -> None:
    loop = run(Push(push))
    for _ in range(ticks):
        tick = loop.step()
    assert tick.binding == expected
    assert all(name in str(tick) for name in expected)


def test_residuals_are_given_per_regime_and_level(run: Any) -> None:
    """Recomputed from the tick's own command in a pure regime, where it is the regime's solution."""
    loop = run()
    tip = loop.robot.pose("tcp", loop.robot.home)[:3, 3]
    seen = set()
    for gap in np.linspace(0.9, 0.15, 120):
        q = loop.q
        tick = loop.step(tip[None] + [gap, 0.0, 0.05])
        assert sum(weight for weight, _ in tick.residuals) == pytest.approx(1.0)
        for weight, residuals in tick.residuals:
            assert 0.0 < weight <= 1.0
            assert all(r >= 0.0 for r in residuals)
        if len(tick.residuals) == 1 and tick.regime != "high":
            ((_, residuals),) = tick.residuals
            J = loop.robot.jacobian("tcp", q)
            velocity = loop.tasks[0].gain * tick.errors[0]  # the path stands still
            assert residuals[0] == pytest.approx(np.linalg.norm(J[:3] @ tick.reference.qd - velocity), abs=1e-9)
            assert residuals[-1] == pytest.approx(np.linalg.norm(tick.reference.qd - tick.qd0), abs=1e-9)
            assert len(residuals) == {"low": 3, "medium": 2}[tick.regime]
            seen.add(tick.regime)
        else:
            seen.add("transition" if len(tick.residuals) == 2 else tick.regime)
    assert seen == {"low", "medium", "high", "transition"}


@pytest.mark.parametrize("dt", [0.004, 0.001, 0.004032])
def test_time_is_the_number_of_the_tick_times_dt(run: Any, dt: float) -> None:
    loop = run(qpsafe.NullspaceLaw(), dt=dt)
    for k in range(50):
        tick = loop.step() if k % 3 else loop.feed(None, None)
        assert tick.reference.seq == k
        assert tick.reference.time == k * dt
        assert 0.0 < tick.solve_time < 60.0
    loop.controller.reset()
    loop.count = 0
    assert loop.step().reference.time == 0.0


def test_the_danger_of_a_bad_tick_is_unknown(run: Any) -> None:
    tick = run().feed(None, None)
    assert np.isnan(tick.cdf_n)
    assert (tick.m, tick.f, tick.activations, tick.regime) == (0.0, 0.0, (0.0, 0.0), "unknown")
    assert tick.residuals == ()


def arrays_in(value: Any, found: dict[int, np.ndarray]) -> None:
    """Every array that can be reached from a tick."""
    if isinstance(value, np.ndarray):
        found[id(value)] = value
    elif isinstance(value, tuple | list):
        for item in value:
            arrays_in(item, found)
    elif dataclasses.is_dataclass(value):
        for field in dataclasses.fields(value):
            arrays_in(getattr(value, field.name), found)
    elif hasattr(value, "qd"):  # a QP's solution
        arrays_in(value.qd, found)


@pytest.mark.parametrize("law", [qpsafe.HierarchicalLaw, qpsafe.WeightedLaw, qpsafe.NullspaceLaw])
@pytest.mark.parametrize("options", [{}, {"limits": None}])
def test_scribbling_on_a_tick_disturbs_nothing(run: Any, law: Any, options: dict[str, Any]) -> None:
    """Neither the next ticks nor earlier ones; bad ticks and distances included."""
    spoilt, clean = run(law(), **options), run(law(), **options)
    rng = np.random.default_rng(0)
    kept: list[tuple[qpsafe.Tick, np.ndarray]] = []
    for k in range(58):
        distances = rng.uniform(0.1, 1.0, 20)
        q, qd = clean.q.copy(), clean.qd.copy()
        if k % 7 == 3:
            q[0] = np.nan
        data = {"distances": distances} if k % 2 else {"points": near(clean, 0.2 + 0.01 * k)}
        tick = spoilt.controller.step(q.copy(), qd.copy(), **{key: value.copy() for key, value in data.items()})
        reference = clean.feed(q, qd, **data).reference
        assert np.array_equal(tick.reference.qd, reference.qd)
        assert np.array_equal(tick.reference.q, reference.q)
        found: dict[int, np.ndarray] = {}
        arrays_in(tick, found)
        assert len(found) >= 5
        for array in found.values():
            if array.flags.writeable:
                array[...] = 77 if array.dtype.kind in "iu" else np.nan
        kept.append((clean.feed(q, qd, **data), clean.q.copy()))
        spoilt.controller.step(q.copy(), qd.copy(), **data)
    for tick, q in kept:
        assert np.array_equal(tick.reference.q, q)
    assert clean.qd.any()


def test_the_caller_may_reuse_his_arrays(run: Any) -> None:
    """One buffer for all ticks, overwritten after each."""
    reused, fresh = run(), run()
    buffer_q, buffer_points = np.empty(N), np.empty((1, 3))
    for k in range(50):
        point = near(fresh, 0.5 - 0.006 * k)
        buffer_q[:], buffer_points[:] = fresh.q, point
        tick = reused.controller.step(buffer_q, fresh.qd.copy(), points=buffer_points)
        buffer_q[:], buffer_points[:] = np.nan, np.nan
        assert np.isfinite(tick.points).all()
        assert np.array_equal(fresh.step(point).reference.qd, tick.reference.qd)


def test_a_reference_cannot_be_rebound() -> None:
    reference = qpsafe.JointReference(0, 0.0, np.zeros(N), np.zeros(N))
    with pytest.raises(dataclasses.FrozenInstanceError):
        reference.q = np.ones(N)  # type: ignore[misc]
