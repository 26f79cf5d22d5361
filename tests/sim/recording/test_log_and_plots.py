"""Logs, their intervals and files, and the figures."""

import csv
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import qpsafe
from qpsafe.sim.drawing.plots import distance_figure, figure_11
from qpsafe.sim.experiments.fixed.experiment import FixedExperiment, euler_error, pose_error
from qpsafe.sim.recording.log import RunLog, intervals
from qpsafe.tasks.rotation import exp3

pytestmark = pytest.mark.long

ROBOT = qpsafe.load_robot("irb140")


@pytest.fixture(scope="module")
def log() -> RunLog:
    return FixedExperiment(ROBOT, duration=0.4).run()


names = st.lists(st.sampled_from(("low", "medium", "high")), min_size=1, max_size=60)


@given(names)
def test_intervals_partition_the_time(sequence: list[str]) -> None:
    time = np.arange(len(sequence)) * 0.5
    found = intervals(time, sequence, 0.5)
    assert found[0].start == 0.0
    assert found[-1].end == time[-1] + 0.5
    for a, b in pairwise(found):
        assert a.end == b.start
        assert a.name != b.name
    rebuilt = [item.name for item in found for _ in range(round((item.end - item.start) / 0.5))]
    assert rebuilt == sequence


@given(names, st.floats(0.0, 3.0))
def test_merged_intervals_are_long_enough(sequence: list[str], shortest: float) -> None:
    found = intervals(np.arange(len(sequence)) * 0.5, sequence, 0.5, shortest)
    assert all(item.end - item.start >= shortest for item in found[1:])


def test_csv_holds_what_the_log_holds(log: RunLog, tmp_path: Path) -> None:
    log.write_csv(tmp_path / "signals.csv")
    assert [p.name for p in tmp_path.iterdir()] == ["signals.csv"]  # no part file left
    with (tmp_path / "signals.csv").open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == len(log.time)
    q = np.array([[float(row[f"q_ref_{i} [rad]"]) for i in range(1, 7)] for row in rows])
    assert q == pytest.approx(log.q_ref, rel=1e-8, abs=1e-12)
    assert [row["regime"] for row in rows] == list(log.regime)


def test_equal_runs_write_equal_files(log: RunLog, tmp_path: Path) -> None:
    again = FixedExperiment(ROBOT, duration=0.4).run()
    for name, run in (("a", log), ("b", again)):
        run.write_csv(tmp_path / name)
    assert (tmp_path / "a").read_bytes() == (tmp_path / "b").read_bytes()


def test_figures_are_pictures(log: RunLog, tmp_path: Path) -> None:
    from matplotlib.image import imread

    figure_11(log, tmp_path / "four.png", "title")
    distance_figure(log, log.board_distance, tmp_path / "two.png")
    for name, shape in (("four.png", (1440, 1152)), ("two.png", (480, 1152))):
        picture = imread(tmp_path / name)
        assert picture.shape[:2] == shape
        assert picture[..., :3].std() > 0.05  # not blank
    assert len(list(tmp_path.iterdir())) == 2


def test_failed_write_leaves_no_file(log: RunLog, tmp_path: Path) -> None:
    with pytest.raises(ValueError, match=r"unsupported|not supported"):
        figure_11(log, tmp_path / "figure.nonsense")
    assert list(tmp_path.iterdir()) == []


def test_pose_errors_lead_back() -> None:
    target, pose = ROBOT.pose("tcp", ROBOT.home), ROBOT.pose("tcp", ROBOT.home + 0.2)
    position, rotation = pose_error(pose, target)
    assert pose[:3, 3] + position == pytest.approx(target[:3, 3], abs=1e-14)
    assert exp3(rotation) @ pose[:3, :3] == pytest.approx(target[:3, :3], abs=1e-12)
    assert euler_error(target, target) == pytest.approx(np.zeros(3))
    assert (np.abs(euler_error(pose, target)) <= np.pi).all()
