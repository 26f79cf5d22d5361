"""Frictions that can be had, evasions of users' making beside them, and whose an evasion is."""

from __future__ import annotations

import copy
import pickle
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import qpsafe
from qpsafe.danger.evasion import Evasion
from qpsafe.errors import ConfigurationError
from qpsafe.plugins.monitor import DangerMonitor

COUPLED = np.array([[4.0, 1.0, 0.0], [1.0, 4.0, 0.0], [0.0, 0.0, 3.0]])
PLAIN = np.diag([4.0, 4.0, 3.0])


class Old(Evasion):
    """Of a user, from before there was friction."""

    def step(self, sigma: Any) -> Any:  # type: ignore[override]
        return super().step(sigma)


def made(**parts: Any) -> qpsafe.SafetyController:
    robot = qpsafe.load_robot("irb140")
    return qpsafe.SafetyController(
        robot, [qpsafe.PositionTask("tcp", qpsafe.FixedPose(robot.pose("tcp", robot.home)))], **parts
    )


@pytest.mark.parametrize(("mass", "damping"), [(COUPLED, PLAIN), (PLAIN, COUPLED), (COUPLED, COUPLED)])
@given(friction=st.floats(1e-3, 1e3))
def test_friction_is_refused_beside_matrices_that_couple_joints(mass: Any, damping: Any, friction: float) -> None:
    with pytest.raises(ConfigurationError, match=r"Evasion: friction = .*expected 0 where mass or damping is not diag"):
        Evasion(mass, damping, 3, friction=friction)
    assert not Evasion(mass, damping, 3).friction.any()
    assert Evasion(PLAIN, PLAIN, 3, friction=friction).friction.all()


@pytest.mark.parametrize("friction", [1e308, [0.0, 1e308, 1.0]])
def test_a_friction_that_cannot_be_computed_with_is_named(friction: Any) -> None:
    with pytest.raises(ConfigurationError, match="Evasion: friction = "):
        Evasion(1e-3, 1e-3, 3, friction=friction)


COPIES = {"copy": copy.copy, "deep copy": copy.deepcopy, "pickle": lambda one: pickle.loads(pickle.dumps(one))}


@pytest.mark.parametrize("how", COPIES)
@pytest.mark.parametrize("name", ["mass", "damping", "friction", "drop"])
def test_what_a_copy_shows_is_read_only_too(how: str, name: str) -> None:
    """What it computes with was made of these: a change would be without effect, and without a word."""
    with pytest.raises(ValueError, match="read-only"):
        getattr(COPIES[how](Evasion(4.0, 20.0, 6, friction=2.0)), name)[:] = 0.0
    with pytest.raises(ValueError, match="read-only"):
        getattr(COPIES[how](made()).evasion, name)[:] = 0.0


def test_a_step_that_knows_nothing_of_who_comes_works_without_friction() -> None:
    robot, ahead = qpsafe.load_robot("irb140"), [[0.9, 0.0, 0.7]]
    monitors = [DangerMonitor(robot, evasion=kind(4.0, 20.0, 6)) for kind in (Old, Evasion)]
    loops = [made(evasion=kind(4.0, 20.0, 6)) for kind in (Old, Evasion)]
    for _ in range(10):
        for one in monitors:
            one.update(robot.home, np.zeros(6), ahead)
        a, b = (loop.step(robot.home, np.zeros(6), points=ahead) for loop in loops)
        assert a.status == b.status == "ok", a.messages
        assert a.qd0 == pytest.approx(b.qd0, rel=1e-9)
    assert monitors[0].qd0.any()
    np.testing.assert_array_equal(monitors[0].qd0, monitors[1].qd0)


@pytest.mark.parametrize("taker", [made, lambda **parts: DangerMonitor(qpsafe.load_robot("irb140"), **parts)])
def test_with_friction_it_is_refused_before_the_first_tick(taker: Any) -> None:
    """Every tick would have been a fault."""
    with pytest.raises(ConfigurationError, match=r"evasion\.step = .*expected step\(sigma, coming\)"):
        taker(evasion=Old.for_robot(qpsafe.load_robot("irb140"), 0.004))


@pytest.mark.parametrize(
    "wrong", [{"gate": "of"}, {"limits": 3.0}, {"recovery": 0.3}, {"barrier": 12.0}, {"spots": "none"}]
)
def test_an_evasion_is_free_after_a_constructor_that_failed(wrong: dict[str, Any]) -> None:
    """Also while somebody keeps the error, and with it what was half made."""
    evasion = Evasion(4.0, 20.0, 6)
    with pytest.raises(ConfigurationError) as kept:
        made(evasion=evasion, **wrong)
    assert made(evasion=evasion).evasion is evasion
    assert kept.value is not None


@pytest.mark.parametrize("how", COPIES)
def test_a_copys_evasion_is_its_own(how: str) -> None:
    robot = qpsafe.load_robot("irb140")
    for one in (made(), DangerMonitor(robot)):
        other = COPIES[how](one)
        assert other.evasion is not one.evasion
        with pytest.raises(ConfigurationError, match="one of its own"):
            made(evasion=other.evasion)
        made(evasion=copy.deepcopy(other.evasion))


def test_evasions_that_are_equal_are_two_all_the_same() -> None:
    class Equal(Evasion):
        def __eq__(self, other: object) -> bool:
            return True

        __hash__ = None  # type: ignore[assignment]

    one, two = Equal(4.0, 20.0, 6), Equal(4.0, 20.0, 6)
    assert made(evasion=one).evasion is one
    first = made(evasion=two)
    assert first.evasion is two
    with pytest.raises(ConfigurationError, match="one of its own"):
        made(evasion=two)
