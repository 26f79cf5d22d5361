"""A trial played again: the same row to the last bit, a table of all ticks, a video where there is OpenGL."""

import csv
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from amounts import first

from qpsafe.sim.campaign.people import EncounterModel
from qpsafe.sim.campaign.plan import Plan
from qpsafe.sim.campaign.show import show
from qpsafe.sim.campaign.trials.meeting import meeting
from qpsafe.sim.campaign.trials.rows import columns_of
from qpsafe.sim.campaign.trials.trial import recorded, run_case, run_trial
from qpsafe.sim.campaign.worst.cases import Encounter

BRAVE = """
def make(station):
    return station.controller()
"""


@pytest.fixture
def dark(monkeypatch: pytest.MonkeyPatch) -> None:
    """No OpenGL."""
    monkeypatch.setattr("qpsafe.sim.drawing.gl.gl_available", lambda: (False, "it is dark"))


def bits(row: dict[str, Any]) -> dict[str, bytes]:
    return {name: values.tobytes() for name, values in columns_of([row]).items()}


def _table(path: Path) -> list[dict[str, str]]:
    with path.open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


@pytest.mark.parametrize("controller", first(1, ["default", "stop"]))
def test_the_row_is_the_campaigns_and_the_table_has_every_tick(tmp_path: Path, people: str, controller: str) -> None:
    plan = Plan(motions=("line",), people=people, controllers=(controller,), seed=4)
    told: list[tuple[int, int]] = []
    shown = show(plan, 2, controller, tmp_path, video=False, progress=lambda *done: told.append(done))
    (row,) = run_trial(plan, 2)
    assert bits(shown.row) == bits(row)
    assert shown.files == (tmp_path / f"trial-2-{controller}.csv",)
    assert [*tmp_path.iterdir()] == [*shown.files]
    met = meeting(plan, 2)
    run, table = recorded(plan, met, controller), _table(shown.files[0])
    ticks = len(met.tracks)
    assert len(table) == ticks
    assert told == [(k + 1, ticks) for k in range(ticks)]
    joints = [f"q {name} [rad]" for name in met.station.robot.joint_names]
    assert np.array([[float(line[name]) for name in joints] for line in table]) == pytest.approx(run.q, abs=1e-8)
    assert min(float(line["distance [m]"]) for line in table) == pytest.approx(row["distance"], abs=1e-6)
    assert [line["phase"] for line in table] == run.phase.tolist()
    assert [float(line["time [s]"]) for line in table] == pytest.approx(0.004 * np.arange(ticks))


@pytest.mark.usefixtures("dark")
def test_a_case_of_an_own_controller_without_opengl(tmp_path: Path, people: str) -> None:
    """One line says why there is no video, the table is there, and no slash of the name makes a folder."""
    (tmp_path / "brave.py").write_text(BRAVE)
    name, out, said = f"{tmp_path}/brave.py:make", tmp_path / "new" / "out", list[str]()
    plan = Plan(people=people, controllers=(name,))
    case = Encounter("hold", tuple([0.3] * EncounterModel.load(people).dimensions))
    shown = show(plan, case, name, out, label="worst-0", notice=said.append)
    assert said == ["no video: it is dark"]
    assert [file.parent for file in shown.files] == [out]
    assert shown.files[0].name.startswith("worst-0-")
    assert "brave.py-make-" in shown.files[0].name
    assert bits(shown.row) == bits(run_case(plan, case, name))


@pytest.mark.slow
@pytest.mark.usefixtures("opengl")
def test_ctrl_c_leaves_no_half_file(tmp_path: Path, people: str) -> None:
    def interrupt(done: int, _: int) -> None:
        if done == 30:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        show(Plan(motions=("hold",), people=people), 0, "default", tmp_path, progress=interrupt)
    assert not list(tmp_path.iterdir())


@pytest.mark.slow
@pytest.mark.usefixtures("opengl")
def test_the_video_shows_a_frame_every_40_ms(tmp_path: Path, people: str) -> None:
    """Also of a controller that knows of no danger vectors."""
    imageio = pytest.importorskip("imageio")
    plan = Plan(motions=("hold",), people=people)
    shown = show(plan, 0, "stop", tmp_path)
    assert [file.suffix for file in shown.files] == [".mp4", ".csv"]
    frames = [frame for frame in imageio.get_reader(shown.files[0])]  # noqa: C416  its length is not known
    assert len(frames) == -(-len(_table(shown.files[1])) // 10)
    assert np.std(frames[0]) > 5.0
    assert np.abs(frames[0].astype(float) - frames[-1]).max() > 50.0  # somebody has come
