"""Whether a robot can pick and place is found out once, each layout checked once, whoever asks and however often."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest
from amounts import some
from hypothesis import given, settings
from hypothesis import strategies as st

import qpsafe
from qpsafe.errors import ConfigurationError
from qpsafe.sim.experiments.pick_place import for_robot
from qpsafe.sim.experiments.pick_place.for_robot import in_the_way, work_for

WHOLE, BLIND, WRONG = "nothing", "sensors", "joints"


class Checked(SimpleNamespace):
    """What `check_path` would say."""

    def _replace(self, sightings: Any) -> Checked:
        return Checked(wrong=self.wrong, sightings=sightings)


@settings(max_examples=some(6, of=60), deadline=None)
@given(st.lists(st.sampled_from([WHOLE, BLIND, WRONG]), min_size=9, max_size=9))
def test_each_layout_is_checked_once_at_most(outcomes: list[str]) -> None:
    robot, asked = qpsafe.load_robot("iiwa14"), []
    for_robot._searched.cache_clear()  # what another draw has found

    def check_path(*_: Any, **__: Any) -> Checked:
        asked.append(outcomes[len(asked)])
        seen = (SimpleNamespace(spot=f"eye {len(asked)}"),) if asked[-1] == BLIND else ()
        return Checked(wrong=asked[-1] == WRONG, sightings=seen)

    def troubles(check: Checked) -> list[str]:
        return ["joints"] * check.wrong + ["sensors"] * bool(check.sightings)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(for_robot, "check_path", check_path)
        patch.setattr(for_robot, "troubles", troubles)
        patch.setattr(for_robot, "parse_program", lambda *_: None)
        patch.setattr(for_robot, "_worth", lambda *_: 1.0)
        patch.setattr(for_robot, "build_scene", lambda *_, **__: None)
        patch.setattr(for_robot, "known_obstacles", lambda *_: None)
        for _ in range(2):
            named = in_the_way(robot)
            if WHOLE in outcomes:
                assert work_for(robot) is work_for(robot)
            else:
                with pytest.raises(ConfigurationError, match="of some layout"):
                    work_for(robot)
    for_robot._searched.cache_clear()
    first = outcomes.index(WHOLE) + 1 if WHOLE in outcomes else len(outcomes)
    assert asked == outcomes[:first]
    blind = [f"eye {k}" for k, outcome in enumerate(outcomes, 1) if outcome == BLIND]
    assert named == (set() if WHOLE in outcomes else set(blind[:1]))
