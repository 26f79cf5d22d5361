"""What a task, a field or an evasion of the user's answers is taken as it is, or the tick is a fault: never guessed."""

import pickle
import tracemalloc
from typing import Any

import numpy as np
import pytest
from amounts import thinned

import qpsafe
from qpsafe.hqp.own import regimes
from qpsafe.limits import KINDS
from qpsafe.tasks.clik import Clik

SPOILT: dict[str, Any] = {
    "a number": lambda a: a.ravel()[0],
    "a number for all": lambda a: np.full((1,) * a.ndim, 0.1),
    "one axis more": lambda a: a[None],
    "one axis less": lambda a: a[0],
    "one too many": lambda a: np.concatenate((a, a[:1])),
    "one too few": lambda a: a[:-1],
    "text": lambda a: a.astype(str),
    "complex": lambda a: a + 1j,
    "truth": lambda a: a > 0.0,
    "objects": lambda a: a.astype(object),
    "masked": lambda a: np.ma.masked_array(a, np.arange(a.size).reshape(a.shape) == 1),
    "None": lambda a: None,
    "ragged": lambda a: [[1.0], [2.0, 3.0]],
    "nothing": lambda a: [],
}
FAIR: dict[str, Any] = {
    "list": lambda a: a.tolist(),
    "Fortran's order": np.asfortranarray,
    "strided": lambda a: np.repeat(a, 2, axis=0)[::2],
    "backwards": lambda a: a[::-1].copy()[::-1],
    "misaligned": lambda a: np.frombuffer(b"x" + a.tobytes(), np.uint8)[1:].view(float).reshape(a.shape),
    "byte order": lambda a: a.astype(">f8"),
    "long double": lambda a: a.astype(np.longdouble),
    "unpickled": lambda a: pickle.loads(pickle.dumps(a)),
    "unmasked": lambda a: np.ma.masked_array(a),
}
PARTS = ("jacobian", "velocity", "error", "value", "gradient", "evasion")


class Spoiler:
    """Does something to one of the answers, once it is told."""

    def __init__(self, part: str) -> None:
        self.part, self.change = part, lambda array: array

    def __call__(self, part: str, array: Any) -> Any:
        return self.change(array) if part == self.part else array


def spoilt_loop(run: Any, robot: Any, spoiler: Spoiler) -> Any:
    class OwnTask(qpsafe.PositionTask):
        def clik(self, state: Any, sample: Any) -> Clik:
            answer = super().clik(state, sample)
            return Clik(*(spoiler(key, value) for key, value in answer._asdict().items()))

    class OwnField(qpsafe.DangerField):
        def evaluate(self, points: Any, wire: Any, point_velocities: Any = None) -> Any:
            value, gradient = super().evaluate(points, wire, point_velocities)
            return spoiler("value", value), spoiler("gradient", gradient)

    class OwnEvasion(qpsafe.Evasion):
        def step(self, sigma: Any) -> Any:
            return spoiler("evasion", super().step(sigma))

    here = qpsafe.FixedPose(robot.pose("tcp", robot.home))
    own_field, own_evasion = spoiler.part in ("value", "gradient"), spoiler.part == "evasion"
    return run(
        tasks=[OwnTask("tcp", here), qpsafe.OrientationTask("tcp", here)],
        field=OwnField() if own_field else None,
        evasion=OwnEvasion(4.0, 20.0, robot.nq) if own_evasion else None,
    )


BOXES: dict[str, Any] = {  # of the right one at a tick
    "None": lambda box: None,
    "a tuple": tuple,
    "NaN": lambda box: box._replace(lower=np.full(6, np.nan)),
    "everything": lambda box: box._replace(lower=np.full(6, -np.inf), upper=np.full(6, np.inf)),
    "a number": lambda box: box._replace(upper=0.3),
    "short": lambda box: box._replace(upper=box.upper[1:]),
    "empty": lambda box: box._replace(lower=box.upper, upper=box.lower),
    "faster": lambda box: box._replace(upper=box.upper + np.eye(6)[3] * 1e-6),
    "standstill": lambda box: box._replace(lower=np.zeros(6), upper=np.zeros(6)),
    "codes": lambda box: box._replace(upper_kind=np.full(6, len(KINDS))),
    "codes below": lambda box: box._replace(sacrificed=np.full(6, -1)),
    "text": lambda box: box._replace(lower=box.lower.astype(str)),
}


@pytest.mark.parametrize("law", [None, qpsafe.NullspaceLaw()])
@pytest.mark.parametrize("kind", thinned(2, BOXES))
def test_a_box_beyond_the_numbers_of_its_limits_is_a_fault(run: Any, irb140: Any, kind: str, law: Any) -> None:
    """`run` watches that no command leaves the robot's limits."""

    class Own(qpsafe.JointLimits):
        change = staticmethod(lambda box: box)

        def box(self, q: Any, qd: Any, qdd: Any = None) -> Any:
            return Own.change(super().box(q, qd, qdd))

    numbers = irb140.lower, irb140.upper, irb140.max_velocity, irb140.max_acceleration
    loop = run(law, limits=Own(*numbers))
    for _ in range(30):
        assert loop.step(near(loop)).status in ("ok", "degraded")
    assert np.abs(loop.qd).max() > 0.2  # too fast to stand still at the next tick
    Own.change = staticmethod(BOXES[kind])
    tick = loop.step(near(loop))
    assert tick.status == "fault"
    assert "limits" in tick.messages[0]
    assert str(tick)
    Own.change = staticmethod(lambda box: box._replace(upper=np.nextafter(box.upper, -1.0)))
    assert loop.step(near(loop)).status in ("ok", "degraded")  # narrower, and so they may be


@pytest.mark.parametrize("law", [None, qpsafe.NullspaceLaw()])
@pytest.mark.parametrize(
    "answer",
    [(np.nan, np.nan), (1.0, np.nan), (1.5, 1.0), (0.0, 1.0), (1.0, -0.5), (), (1.0,), (1.0,) * 3, "ab", None, (1j, 0)],
)
def test_activations_that_are_none_are_a_fault(run: Any, law: Any, answer: Any) -> None:
    class Own(qpsafe.Activation):
        answer: Any = (1.0, 1.0)

        def activations(self, cdf_n: float) -> Any:
            return Own.answer

    loop = run(law, activation=Own())
    assert loop.step().status == "ok"
    Own.answer = answer
    assert loop.step().status == "fault"
    Own.answer = (1.0, 0.5)
    assert loop.step().status == "ok"


def test_a_task_whose_rows_change_for_ever_does_not_fill_the_memory(
    run: Any, irb140: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(regimes, "_layouts", {})  # whatever tests before have left in it
    rows = [0]

    class Own(qpsafe.PositionTask):
        def clik(self, state: Any, sample: Any) -> Clik:
            rows[0] += 1
            answer = super().clik(state, sample)
            return Clik(*(np.resize(part, (rows[0], *part.shape[1:])) for part in answer))

    loop = run(tasks=[Own("tcp", qpsafe.FixedPose(irb140.pose("tcp", irb140.home)))])
    for _ in range(70):
        assert loop.step().status == "ok"
    tracemalloc.start()
    sizes = []
    for _ in range(150):
        loop.step()
        sizes.append(tracemalloc.get_traced_memory()[0])
    tracemalloc.stop()
    assert min(sizes[-70:]) < max(sizes[:70])  # it is let go


def near(loop: Any) -> np.ndarray:
    return loop.robot.pose("tcp", loop.q)[:3, 3] + np.array([[0.2, 0.02, 0.0], [0.3, 0.1, 0.0], [0.4, 0.0, 0.1]])


@pytest.mark.parametrize("kind", thinned(2, SPOILT))
@pytest.mark.parametrize("part", PARTS)
def test_an_answer_that_is_no_array_of_its_numbers_is_a_fault(run: Any, irb140: Any, part: str, kind: str) -> None:
    spoiler = Spoiler(part)
    loop = spoilt_loop(run, irb140, spoiler)
    for _ in range(8):
        assert loop.step(near(loop)).status == "ok"
    spoiler.change = SPOILT[kind]
    tick = loop.step(near(loop))
    assert tick.status == "fault", tick.messages
    assert tick.qd0.shape == (6,)
    assert str(tick)
    spoiler.change = lambda array: array
    assert loop.step(near(loop)).status == "ok"


@pytest.mark.parametrize("kind", thinned(2, FAIR))
@pytest.mark.parametrize("part", PARTS)
def test_how_an_answer_lies_in_memory_does_not_matter(run: Any, irb140: Any, part: str, kind: str) -> None:
    spoiler = Spoiler(part)
    loop, plain = spoilt_loop(run, irb140, spoiler), spoilt_loop(run, irb140, Spoiler(part))
    spoiler.change = FAIR[kind]
    for _ in range(12):
        one, other = loop.step(near(loop)), plain.step(near(plain))
        assert one.reference == other.reference
        assert (one.status, one.messages) == (other.status, other.messages)
