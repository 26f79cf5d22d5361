"""The servo of a trial: perfect, or joints of second order behind a delay."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from qpsafe.sim.campaign.trials.servo import DT, OMEGA, Servo


def references(ticks: int) -> list[tuple[np.ndarray, np.ndarray]]:
    """Of two joints that speed up and slow down; each position is where its velocity leads in a tick."""
    q, found = np.array([0.3, -0.2]), []
    for k in range(ticks):
        qd = np.array([np.sin(0.05 * k), 0.5 * np.cos(0.03 * k) - 0.5])
        q = q + DT * qd
        found.append((q, qd))
    return found


def test_without_lag_the_robot_is_where_it_was_told() -> None:
    servo = Servo(np.array([0.3, -0.2]))
    for q, qd in references(20):
        servo.follow(q, qd)
        assert (servo.q == q).all()
        assert (servo.qd == qd).all()


@pytest.mark.parametrize("delay", [1, 3])
def test_with_lag_it_is_the_delayed_oscillator(delay: int) -> None:
    """Against numerical integration of q'' = ω² (r - q) + 2 ω (r' - q')."""
    omega, start = OMEGA, np.array([0.3, -0.2])
    servo, told = Servo(start, lag=delay * DT), references(60)
    state = np.concatenate((start, np.zeros(2)))
    for k, (q, qd) in enumerate(told):
        servo.follow(q, qd)
        if k >= delay:
            goal, speed = told[k - delay]

            def motion(t: float, x: np.ndarray, goal: np.ndarray = goal, speed: np.ndarray = speed) -> np.ndarray:
                r = goal - speed * (DT - t)
                return np.concatenate((x[2:], omega**2 * (r - x[:2]) + 2.0 * omega * (speed - x[2:])))

            state = solve_ivp(motion, (0.0, DT), state, rtol=1e-10, atol=1e-12).y[:, -1]
        assert servo.q == pytest.approx(state[:2], abs=1e-8)
        assert servo.qd == pytest.approx(state[2:], abs=1e-6)
