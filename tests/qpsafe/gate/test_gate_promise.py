"""What the gate promises, under commands that want the opposite."""

from __future__ import annotations

from typing import Any

import pytest

import qpsafe
from qpsafe.gate.rules import VerifiedMotion

ROBOTS = ("irb140", "iiwa14", "irb14000")


@pytest.mark.parametrize("name", ROBOTS)
def test_nobody_who_could_be_touched_is_approached_and_nothing_is_touched(name: str, plays: Any) -> None:
    robot = qpsafe.load_robot(name)
    held = 0
    for seed in range(3):
        told = plays.play(robot, seed, 1_000, look=2)
        assert told.approach <= VerifiedMotion().approach + 1e-6
        assert told.short == 0
        assert told.kept_clear(VerifiedMotion().margin)
        assert told.excess <= 1e-12
        held += told.held
    assert held > 100  # the plays ask for what is not let through


@pytest.mark.parametrize("broken", ["fast", "appear"])
def test_where_people_do_what_was_not_reckoned_with_it_is_told(broken: str, plays: Any) -> None:
    robot = qpsafe.load_robot("irb140")
    shorts, brakes = 0, []
    for seed in range(4):
        told = plays.play(
            robot, seed, 800, fastest=6.0 if broken == "fast" else 1.6, appear=broken == "appear", people=6
        )
        shorts += told.short
        brakes += told.retreats
        assert told.approach <= VerifiedMotion().approach + 1e-6  # wherever it is not told
        assert told.kept_clear(VerifiedMotion().margin)  # that holds whatever people do
        assert told.excess <= 1e-12
    assert shorts > 0
    assert all(brakes)  # braking at the limits, or all of a command that comes nearer by less


@pytest.mark.slow
@pytest.mark.parametrize("name", ROBOTS)
def test_a_million_ticks(name: str, plays: Any) -> None:
    robot, ticks = qpsafe.load_robot(name), 0
    for seed in range(1_000, 1_084):
        told = plays.play(robot, seed, 4_000, people=seed % 5, look=8)
        ticks += 4_000
        assert told.approach <= VerifiedMotion().approach + 1e-6, seed
        assert (told.short, told.excess <= 1e-12) == (0, True), seed
        assert told.kept_clear(VerifiedMotion().margin), seed
    assert ticks == 336_000  # a third of the million, a robot
