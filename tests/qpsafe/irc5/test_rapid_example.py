"""The RAPID module that a robot loads agrees with its README and with what the PC does."""

from __future__ import annotations

import math
import re
from inspect import signature
from pathlib import Path

import pytest

from qpsafe.controller import SafetyController
from qpsafe.irc5.loop import LoopRules
from qpsafe.irc5.messages import DEFAULT_PORT
from qpsafe.irc5.rules import SessionRules
from qpsafe.sim.irc5.motion import EgmSettings

FOLDER = Path(__file__).parents[3] / "examples" / "rapid"
MODULE, README = ((FOLDER / name).read_text(encoding="utf-8") for name in ("qpsafe_egm.mod", "README.md"))
#: Constants, by name.
VALUES = {name: float(value) for name, value in re.findall(r"CONST num (\w+) := ([\d.]+);", MODULE)}


def argument(instruction: str, name: str) -> float:
    """What an optional argument of an instruction is, through the constant that it names."""
    call = re.search(rf"^ *{instruction} [^;]*;", MODULE, re.MULTILINE)
    assert call is not None
    given = re.search(rf"\\{name}:=(\w+)", call[0])
    assert given is not None
    return VALUES[given[1]]


def test_the_robots_ramp_is_over_before_the_pcs() -> None:
    """Both blend in from the measured pose; were the robot's the longer one, it would lag behind what it is sent."""
    assert 0.0 <= argument("EGMRunJoint", "RampInTime") <= SessionRules().ramp_in


def test_the_pc_has_stopped_the_stream_before_the_robot_gives_up_on_it() -> None:
    assert LoopRules().silence < argument("EGMSetupUC", "CommTimeout")


def test_the_robot_follows_at_the_pcs_period_and_as_simulated() -> None:
    simulated, period = EgmSettings(), signature(SafetyController).parameters["dt"].default
    assert argument("EGMActJoint", "SampleRate") == 1e3 * period
    assert argument("EGMActJoint", "LpFilter") == simulated.lowpass
    assert math.radians(argument("EGMActJoint", "MaxSpeedDeviation")) == pytest.approx(simulated.max_speed_deviation)
    assert argument("EGMRunJoint", "PosCorrGain") == 1.0  # 0: speeds alone, positions would drift


def test_every_number_is_in_the_readme() -> None:
    said = dict(re.findall(r"`(\w+)` ([\d.]+)", README))
    assert {name: float(said[name]) for name in VALUES if name in said} == {
        n: v for n, v in VALUES.items() if n in said
    }
    assert set(VALUES) - set(said) <= {"pause"}
    assert str(DEFAULT_PORT) in README
