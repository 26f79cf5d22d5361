"""Fields of another making choose from what images show, too: in any numbers, as many as there are points, finite."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import qpsafe
from qpsafe.danger.evasion import link_vectors, virtual_torque
from qpsafe.danger.field import danger_vectors
from qpsafe.ranging.ranged import DANGER, GRADIENT, VELOCITY
from qpsafe.ranging.ranging import RangeSensing
from qpsafe.ranging.sensor import RangeSensor

ANSWERS: dict[str, tuple[Callable[[np.ndarray], Any], str]] = {
    "single": (lambda values: values.astype(np.float32), "ok"),
    "a list": (lambda values: values.tolist(), "ok"),
    "of any strides": (lambda values: np.repeat(values, 2)[::2], "ok"),
    "too few": (lambda values: values[:1], "fault"),
    "too many": (lambda values: np.append(values, 0.0), "fault"),
    "in a column": (lambda values: values[:, None], "fault"),
    "text": (lambda values: ["much"] * len(values), "fault"),
    "one that is none": (
        lambda values: np.where(np.arange(len(values)) == len(values) - 1, np.nan, values),
        "bad_input",
    ),
    "all infinite": (lambda values: np.full(len(values), np.inf), "bad_input"),
}


class Field:
    """A field of another making."""

    def __init__(self, answer: Callable[[np.ndarray], Any]) -> None:
        self._own, self._answer = qpsafe.DangerField(), answer

    def evaluate(self, *given: Any) -> tuple[Any, Any]:
        """The usual one, said in another way."""
        values, gradient = self._own.evaluate(*given)
        return self._answer(values), gradient


@pytest.mark.parametrize("what", ANSWERS)
def test_a_field_of_another_making_is_asked_about_images_as_about_points(run: Any, eyes: Any, what: str) -> None:
    answer, status = ANSWERS[what]
    sensor = RangeSensor.array("array", pose=eyes.looking((0.2, 0.0, 0.6), (1.6, 0.3, 0.9)))
    read = np.where(np.arange(64) % 2 == 0, 1.0, np.inf)
    ticks = []
    for field in (qpsafe.DangerField(), Field(answer)):
        loop = run(spots="off", range_sensors=[sensor], field=field)
        ticks.append(loop.feed(loop.q, loop.qd, images=[sensor.image(read, stamp=0.0)], now=0.0))
    usual, other = ticks
    assert len(usual.near) > 1
    assert other.status == status, other.messages
    if status == "ok":
        assert other.cdf_n == pytest.approx(usual.cdf_n, rel=1e-6)


@pytest.mark.parametrize("spots", [True, False])
def test_what_images_show_is_as_dangerous_as_the_field_says(run: Any, eyes: Any, spots: bool, monkeypatch: Any) -> None:
    """What counts comes with its danger and gradient: those of (5) there, and pushed by (6), (8), (14), (15)."""
    place = eyes.looking((0.2, 0.0, 0.6), (1.6, 0.3, 0.9))
    sensor, rng = RangeSensor.array("array", pose=place), np.random.default_rng(7)
    evasion = qpsafe.Evasion(1.0, 10.0, 6)  # friction has tests of its own
    loop, told = run(**({} if spots else {"spots": "off"}), range_sensors=[sensor], evasion=evasion), []
    update = RangeSensing.update
    monkeypatch.setattr(RangeSensing, "update", lambda *given: told.append(update(*given)) or told[-1])
    field, robot, moving = qpsafe.DangerField(), loop.controller.robot, 0
    (A, B), evasive = loop.controller.evasion.matrices, np.zeros(robot.nq)
    for k in range(200):
        images = []
        if k % 10 == 0:  # somebody comes
            read = eyes.seen(sensor, place, [(1.3 - 0.003 * k, 0.1, 0.7, 0.2)]) + rng.normal(0.0, 0.003, len(sensor))
            images = [sensor.image(read, stamp=0.004 * k)]
        given = {"distances": rng.uniform(0.3, 2.0, len(loop.controller.spots))} if spots else {}
        state, wire = robot.at(loop.q), robot.wire(loop.q, loop.qd)
        tick = loop.feed(loop.q, loop.qd, images=images, now=0.004 * k, **given)
        more = told[-1].points
        moving += len(more) > 0 and bool(more[:, VELOCITY : VELOCITY + 3].any())
        value, gradient = field.evaluate(more[:, :3], wire, more[:, VELOCITY : VELOCITY + 3])
        np.testing.assert_allclose(more[:, DANGER], value, rtol=1e-12)
        np.testing.assert_allclose(more[:, GRADIENT:], gradient, rtol=1e-12, atol=1e-12)
        last = len(tick.points) - len(more)
        np.testing.assert_array_equal(tick.points[last:], more[:, :3])
        np.testing.assert_allclose(tick.vectors[last:], danger_vectors(value, gradient), rtol=1e-12, atol=1e-12)
        assert tick.cdf_n == value.max(initial=0.0) or (spots and tick.cdf_n > value.max(initial=0.0))
        torque = virtual_torque(state, link_vectors(tick.vectors, tick.links, len(robot.wire_frames)))
        evasive = A @ evasive + B @ torque  # (16)
        np.testing.assert_allclose(tick.qd0, evasive, rtol=1e-9, atol=1e-12)
    assert moving > 50
