"""Fields of another making choose from what images show, too: in any numbers, as many as there are points, finite."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import qpsafe
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
