"""What a task, a field or an evasion of the user's answers is taken as it is, or the tick is a fault: never guessed."""

from typing import Any

import numpy as np
import pytest

import qpsafe
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


def near(loop: Any) -> np.ndarray:
    return loop.robot.pose("tcp", loop.q)[:3, 3] + np.array([[0.2, 0.02, 0.0], [0.3, 0.1, 0.0], [0.4, 0.0, 0.1]])


@pytest.mark.parametrize("kind", SPOILT)
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


@pytest.mark.parametrize("kind", FAIR)
@pytest.mark.parametrize("part", PARTS)
def test_how_an_answer_lies_in_memory_does_not_matter(run: Any, irb140: Any, part: str, kind: str) -> None:
    spoiler = Spoiler(part)
    loop, plain = spoilt_loop(run, irb140, spoiler), spoilt_loop(run, irb140, Spoiler(part))
    spoiler.change = FAIR[kind]
    for _ in range(12):
        one, other = loop.step(near(loop)), plain.step(near(plain))
        assert one.reference == other.reference
        assert (one.status, one.messages) == (other.status, other.messages)
