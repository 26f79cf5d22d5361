"""The motor side: inverse of the arm side, same power, same servo; never by accident."""

from __future__ import annotations

import numpy as np
import pytest

from qpsafe.errors import ConfigurationError
from qpsafe.irc5.records.gears import GearRatios
from qpsafe.reference import JointReference, ServoGains

RATIOS = np.array([100.0, -121.0, 90.5, 60.0, -50.0, 40.0])


def a_coupling() -> np.ndarray:
    coupling = np.zeros((6, 6))
    coupling[4, 3], coupling[5, 3], coupling[5, 4] = 1.0, -1.0, 0.5
    return coupling


def a_reference(gains: bool) -> JointReference:
    random = np.random.default_rng(0)
    q, qd, torque = random.normal(size=(3, 6))
    return JointReference(
        3, 0.012, q, qd, True, torque, ServoGains(*random.uniform(1, 9, size=(3, 6))) if gains else None
    )


def close(a: JointReference, b: JointReference) -> bool:
    pairs = [(a.q, b.q), (a.qd, b.qd), (a.torque, b.torque), *zip(a.gains or (), b.gains or (), strict=True)]
    return (a.seq, a.time, a.active) == (b.seq, b.time, b.active) and all(
        np.allclose(x, y, rtol=1e-12) for x, y in pairs
    )


@pytest.mark.parametrize(("coupling", "gains"), [(None, True), (None, False), (a_coupling(), False)])
def test_there_and_back(coupling: np.ndarray | None, gains: bool) -> None:
    gears = GearRatios(RATIOS, coupling, offset=np.arange(6.0))
    reference = a_reference(gains)
    assert close(gears.to_arm(gears.to_motor(reference)), reference)


@pytest.mark.parametrize("coupling", [None, a_coupling()])
def test_both_sides_have_the_same_power_and_speed_ratio(coupling: np.ndarray | None) -> None:
    gears = GearRatios(RATIOS, coupling)
    reference = a_reference(False)
    motor = gears.to_motor(reference)
    assert np.isclose(motor.torque @ motor.velocity, reference.torque @ reference.qd, rtol=1e-12)
    step = 1e-6
    ahead = gears.to_motor(JointReference(4, 0.0, reference.q + step * reference.qd, reference.qd))
    assert np.allclose((ahead.position - motor.position) / step, motor.velocity, rtol=1e-6)


def test_the_same_servo_on_both_sides() -> None:
    """The torque that the gains make of an error, carried over, is what the carried gains make of the carried error."""
    gears = GearRatios(RATIOS)
    reference = a_reference(True)
    motor = gears.to_motor(reference)
    random = np.random.default_rng(1)
    q, qd, integral = random.normal(size=(3, 6))

    def torque(
        gains: ServoGains, error: np.ndarray, velocity: np.ndarray, measured: np.ndarray, rest: np.ndarray
    ) -> np.ndarray:
        return gains.kv * (velocity + gains.kp * error - measured) + gains.ki * rest

    arm_side = torque(reference.gains, reference.q - q, reference.qd, qd, integral)
    motor_q = gears.to_motor(JointReference(0, 0.0, q, qd))
    motor_integral = gears.matrix @ integral
    found = torque(motor.gains, motor.position - motor_q.position, motor.velocity, motor_q.velocity, motor_integral)
    assert np.allclose(found, np.linalg.solve(gears.matrix.T, arm_side), rtol=1e-10)


def test_gains_do_not_go_through_coupled_gears_unseen() -> None:
    with pytest.raises(ConfigurationError, match=r"(?s)gains\.k.*coupled gears mix them"):
        GearRatios(RATIOS, a_coupling()).to_motor(a_reference(True))


def test_a_coupled_wrist_by_hand() -> None:
    """Joint 4 turns by 1: its motor turns by 60, those of 5 and 6 turn along."""
    motor = GearRatios(RATIOS, a_coupling()).to_motor(JointReference(0, 0.0, np.eye(6)[3], np.zeros(6)))
    assert motor.position.tolist() == [0.0, 0.0, 0.0, 60.0, 1.0, -1.0]


@pytest.mark.parametrize(
    ("arguments", "key"),
    [
        (([],), "ratios"),
        (([1.0, 0.0],), "ratios"),
        (([1.0, np.nan],), "ratios"),
        (("six",), "ratios"),
        (([1.0, 2.0], np.eye(2)), "coupling"),
        (([1.0, 2.0], np.zeros((2, 3))), "coupling"),
        (([1.0, 1.0], [[0.0, 1.0], [1.0, 0.0]]), "coupling"),
        (([1.0, 2.0], None, [0.0]), "offset"),
    ],
)
def test_wrong_gears_are_refused_by_name(arguments: tuple, key: str) -> None:
    with pytest.raises(ConfigurationError) as caught:
        GearRatios(*arguments)
    assert caught.value.key == key
