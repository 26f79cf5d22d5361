"""Which robots a page can show."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from qpsafe.cli.common import console
from qpsafe.cli.web import ready_robot
from qpsafe.sim.web.setup import HOLD, NOBODY, Setup


@pytest.mark.slow
def test_a_bare_urdf_gets_sensors_and_a_name_stays_a_name(
    arms: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    name = ready_robot(str(arms.write_arm(tmp_path)), console(True))
    experiment = Setup(name, HOLD, NOBODY).experiment()
    assert experiment.robot.spots_path is not None
    assert experiment.robot.nq == 6
    assert ready_robot("iiwa14", console(True)) == "iiwa14"
