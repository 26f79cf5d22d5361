"""An arm that its stated torques cannot hold is said, refused where it is simulated, and found out in a report."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from amounts import some
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from qpsafe.errors import ConfigurationError
from qpsafe.robot.loader import load_quietly
from qpsafe.sim.experiments.shared.following import LATE, OFF, farthest_off
from qpsafe.sim.experiments.shared.strength import LEAST, STRONG, bearable
from qpsafe.sim.world.plant import Plant
from qpsafe.sim.world.robot_spec import torques
from qpsafe.sim.world.scene import build_scene

pytestmark = pytest.mark.long

AGAIN = [HealthCheck.function_scoped_fixture]


@settings(max_examples=some(3, of=12), deadline=None, suppress_health_check=AGAIN)
@given(st.lists(st.floats(-2.0, 1.5), min_size=6, max_size=6))
def test_what_the_stated_torques_do_not_bear_is_said(arms: Any, tmp_path: Path, powers: list[float]) -> None:
    """Torques from a hundredth of the usual to thirty times: what is said agrees with what is needed."""
    axes = tuple((*axis[:3], axis[3] * 10.0**power) for axis, power in zip(arms.SIX, powers, strict=True))
    robot = load_quietly(arms.write_arm(tmp_path, axes))
    share, said = bearable(robot)
    moving, holding = torques(robot)
    stated = np.array([axis[3] for axis in axes])
    assert LEAST <= share <= 1.0
    for name, limit, needed in zip(robot.joint_names, stated, holding.max(axis=0), strict=True):
        words = [item for item in said if item.startswith(f"joint {name}: ")]
        assert len(words) == (needed > limit)
        assert not words or f"{needed:.3g} N m hold it, {limit:.3g} are stated" in words[0]
    borne = bool((share * moving + holding <= STRONG * stated + 1e-9).all())
    assert borne is not any("even these" in item for item in said)
    assert (share < 1.0) is any("accelerations reduced" in item for item in said)
    assert not any("100 %" in item for item in said)


@settings(max_examples=some(3, of=12), deadline=None, suppress_health_check=AGAIN)
@given(st.integers(1, 4), st.floats(0.02, 3.0))
def test_a_joint_too_weak_to_hold_the_arm_is_refused(arms: Any, tmp_path: Path, weak: int, share: float) -> None:
    robot = load_quietly(arms.write_arm(tmp_path))
    data = build_scene(robot).make_data()
    needed = abs(float(data.qfrc_bias[weak]))
    axes = [(*axis[:3], share * needed if j == weak else axis[3]) for j, axis in enumerate(arms.SIX)]
    scene = build_scene(load_quietly(arms.write_arm(tmp_path, tuple(axes))))
    if share >= 1.0 and needed > 1e-6:
        plant = Plant(scene)
        plant.advance(0.02)
        assert np.abs(plant.q - scene.robot.home).max() < 1e-4
    elif needed > 1e-6:
        with pytest.raises(ConfigurationError, match=rf"torque of joint axis_{weak + 1} = .* hold it"):
            Plant(scene)


@settings(max_examples=some(5, of=30), deadline=None)
@given(st.integers(0, 2**32 - 1), st.integers(0, 25), st.floats(2.0 * OFF, 2.0), st.booleans())
def test_a_joint_beside_its_commands_is_found_and_lag_is_none(seed: int, lag: int, off: float, up: bool) -> None:
    rng = np.random.default_rng(seed)
    told = np.cumsum(rng.uniform(-0.01, 0.01, (400, 3)), axis=0)
    late = np.concatenate((np.repeat(told[:1], lag, axis=0), told))[:400]
    log: Any = SimpleNamespace(dt=0.004, q_ref=told, q=late.copy())
    assert lag * 0.004 <= 0.5 * LATE
    assert farthest_off(log)[0] == 0.0
    joint, tick = int(rng.integers(3)), int(rng.integers(400))
    recent = told[max(tick - 50, 0) : tick + 1, joint]
    log.q[tick, joint] = recent.max() + off if up else recent.min() - off
    if tick >= 50:
        assert farthest_off(log) == (pytest.approx(off), joint)
    else:
        assert farthest_off(log)[0] > 0.0 or tick == 0  # the first is where it starts
