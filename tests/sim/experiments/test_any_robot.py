"""Any robot in the experiments: what is chosen suits it and is written down; what it cannot do is refused at once."""

from __future__ import annotations

import json
import warnings
from importlib import metadata
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner

from qpsafe.check.check import check_path
from qpsafe.cli.main import app
from qpsafe.errors import ConfigurationError
from qpsafe.robot.loader import bundled_robots, load_robot
from qpsafe.sensing.skin.spots import load_spots
from qpsafe.sim.experiments.fixed.experiment import FixedExperiment
from qpsafe.sim.experiments.path.experiment import PathExperiment
from qpsafe.sim.experiments.path.for_robot import LENGTH, line_for
from qpsafe.sim.experiments.pick_place.experiment import PickPlaceExperiment
from qpsafe.sim.experiments.pick_place.for_robot import HANDS, work_for
from qpsafe.sim.experiments.pick_place.report import figures
from qpsafe.sim.experiments.shared.home import GOOD, Arm, Touching, quality
from qpsafe.sim.experiments.shared.ready import made_ready
from qpsafe.sim.experiments.shared.report import Check, all_kept, summarise
from qpsafe.sim.replay.settings import experiment_of, settings_of
from qpsafe.sim.world.rays import SpotRays
from qpsafe.sim.world.scene import build_scene
from qpsafe.sim.world.tool_axis import tool_axis
from qpsafe.tasks.program_file import parse_program

pytestmark = pytest.mark.long


@pytest.fixture(scope="module", params=["SEVEN", pytest.param("SIX", marks=pytest.mark.slow)])
def ready(request: pytest.FixtureRequest, arms: Any, tmp_path_factory: pytest.TempPathFactory) -> Any:
    """A bare URDF made ready, and the folder."""
    folder = tmp_path_factory.mktemp("ready")
    file = arms.write_arm(folder, getattr(arms, request.param))
    return made_ready("test", str(file), folder / "out"), folder / "out" / "robot"


def test_home_is_chosen_tool_down_away_from_trouble(ready: Any) -> None:
    robot = ready[0].robot
    arm = Arm.of(robot)
    assert quality(robot, arm, robot.home) > 0.5 * GOOD
    assert Touching(robot)(robot.home) == 0
    pose = robot.pose(arm.tool, robot.home)
    np.testing.assert_allclose(pose[:3, :3] @ tool_axis(robot, arm.tool), [0.0, 0.0, -1.0], atol=1e-6)
    ahead = (pose[:3, 3] - arm.shoulder) / arm.length
    assert 0.3 < ahead[0] < 0.7
    assert abs(ahead[1]) < 0.05


def test_what_was_chosen_is_a_robot_folder_that_loads_as_the_same_robot(ready: Any) -> None:
    made, folder = ready
    again = load_robot(folder)
    np.testing.assert_array_equal(again.home, made.robot.home)
    np.testing.assert_array_equal(again.max_acceleration, made.robot.max_acceleration)
    assert again.spots_path == made.robot.spots_path
    said = "; ".join(made.said)
    assert "home posture chosen" in said
    assert f"{len(load_spots(again))} distance sensors" in said
    assert str(folder) in said
    assert made_ready("test", str(folder), folder / "unused").said == ()  # it has all now
    assert not (folder / "unused").exists()


def test_its_sensors_look_outwards_and_do_not_see_the_robot(ready: Any) -> None:
    robot = ready[0].robot
    spots, experiment = load_spots(robot), FixedExperiment(robot)
    assert len(spots) >= 8
    assert len(set(spots.links.tolist())) >= 2
    scene = experiment.scene
    seen = SpotRays(scene, spots).distances(scene.make_data(), robot.at(robot.home))
    assert (seen > spots.range_min).all()
    alone = build_scene(robot, people=())
    seen = SpotRays(alone, spots).distances(alone.make_data(), robot.at(robot.home))
    assert (seen > spots.range_max).all()  # nor the pedestal, nor the floor


def test_nobody_there_it_keeps_its_pose(ready: Any) -> None:
    log = FixedExperiment(ready[0].robot, duration=0.2).run()
    assert set(log.status) == {"ok"}
    assert np.abs(log.position_error).max() < 1e-6
    assert set(log.regime) == {"low"}


@pytest.mark.slow
def test_its_line_goes_through_its_home_and_nothing_is_wrong_with_it(ready: Any) -> None:
    robot = ready[0].robot
    arm = Arm.of(robot)
    program = parse_program(line_for(robot), "line", robot)
    check = check_path(robot, program)
    assert check.good, check.kept
    ends = [program.sample(t).pose[:3, 3] for t in (0.0, 0.5 * program.duration)]
    np.testing.assert_allclose(np.mean(ends, axis=0), robot.pose(arm.tool, robot.home)[:3, 3], atol=1e-6)
    assert 0.1 <= np.linalg.norm(ends[0] - ends[1]) <= LENGTH + 1e-9
    experiment = PathExperiment(robot, duration=0.2)
    run = experiment.run_path()
    assert np.abs(run.log.position_error).max() < 1e-3
    again = experiment_of(json.loads(json.dumps(settings_of(experiment))))
    np.testing.assert_array_equal(again.start, experiment.start)
    assert again.choreography == experiment.choreography


def test_the_irb_140_has_the_lines_and_people_it_had() -> None:
    robot = load_robot("irb140")
    work = work_for(robot)
    assert (work.pedestal, work.cell.support.centre) == (pytest.approx(0.55), (0.44, 0.40))
    assert 'frame = "tcp"' in PathExperiment(robot).program_text
    story = PickPlaceExperiment(robot).story
    assert story is not None
    assert story.table.person[0].start == (0.45, -2.7)


@pytest.mark.slow
def test_its_work_is_in_reach_and_people_come_to_where_it_is(arms: Any, tmp_path: Path) -> None:
    """One screw, from the support into the box, with the bundled people at the moved tables."""
    robot = made_ready("test", str(arms.write_arm(tmp_path)), tmp_path / "out").robot
    work = work_for(robot)
    assert work.pedestal + work.cell.top == pytest.approx(HANDS)
    experiment = PickPlaceExperiment(robot, cycles=1)
    run = experiment.run()
    found = figures(run)
    assert (found.delivered, found.missed, found.lost, found.finished) == (1, 0, 0, True)
    assert found.clearance > 0.0
    assert experiment.story is not None
    box = np.array(work.cell.box.centre)
    ada = experiment.story.table.person[0]
    np.testing.assert_allclose(np.array(ada.start) - box, [0.01, -2.3], atol=1e-9)  # as far from the box as ever
    again = experiment_of(json.loads(json.dumps(settings_of(experiment))))
    np.testing.assert_array_equal(again.start, experiment.start)
    assert again.cell == experiment.cell
    assert again.story.table == experiment.story.table


@pytest.mark.slow
@pytest.mark.parametrize("name", ["ur5", "panda", "xarm7"])
def test_models_of_other_packages_hold_their_pose_and_follow_a_line(name: str, tmp_path: Path) -> None:
    """Real arms, nothing about them stated here: the whole first experiment keeps what counts."""
    try:
        metadata.distribution("example-robot-data")
    except metadata.PackageNotFoundError:
        pytest.skip("example-robot-data is not installed: pip install 'qpsafe[models]'")
    made = made_ready("test", f"example_robot_data:{name}", tmp_path, 6)
    robot = made.robot
    assert quality(robot, Arm.of(robot), robot.home) > 0.5 * GOOD
    assert check_path(robot, parse_program(line_for(robot), "line", robot), sensors=False).good
    experiment = FixedExperiment(robot)
    log = experiment.run()
    without = experiment.board_distance_without_controller()
    report = summarise(log, without, experiment.windows(), robot, tuned=False)
    assert report.kept, [check for check in report.checks if not check.kept]
    assert (log.regime == "high").any()  # it saw somebody


@pytest.mark.parametrize(("joints", "command"), [(3, "fixed"), (5, "path"), (5, "pick-and-place"), (3, "fast-person")])
def test_too_few_joints_are_refused_before_anything_is_written(
    joints: int, command: str, arms: Any, tmp_path: Path
) -> None:
    file, out = arms.write_arm(tmp_path, arms.SIX[:joints]), tmp_path / "out"
    result = CliRunner().invoke(app, ["demo", command, "--robot", str(file), "--out", str(out)])
    assert isinstance(result.exception, ConfigurationError)
    assert f"on {joints} joints" in str(result.exception)
    assert "joints or more between base and tool" in str(result.exception)
    assert not out.exists()


@pytest.mark.slow
def test_a_robot_that_slides_is_made_ready_too(arms: Any, tmp_path: Path) -> None:
    """A seventh axis that slides the arm along: its home is chosen, its motor is added, it stands still."""
    axes = (((0.0, 0.0, 0.2), (0.0, 0.0, 0.0), (0, 1, 0), 500.0), *arms.SIX)
    made = made_ready("test", str(arms.write_arm(tmp_path, axes, slides=1)), tmp_path / "out")
    assert made.robot.sliding.tolist() == [True, *[False] * 6]
    log = FixedExperiment(made.robot, duration=0.1).run()
    assert set(log.status) == {"ok"}
    assert np.abs(log.q - made.robot.home).max() < 1e-6


@pytest.mark.slow
def test_four_joints_are_enough_to_hold_a_pose(arms: Any, tmp_path: Path) -> None:
    made = made_ready("test", str(arms.write_arm(tmp_path, arms.SIX[:4])), tmp_path / "out", joints=4)
    assert quality(made.robot, Arm.of(made.robot), made.robot.home) > 0.05
    assert set(FixedExperiment(made.robot, duration=0.1).run().status) == {"ok"}


@pytest.mark.slow
def test_only_the_listed_robots_promise_what_was_tuned_for_them(arms: Any, tmp_path: Path) -> None:
    """The order of Table I and how far a tool turns are shown for others; everything else still counts."""
    from qpsafe.sim.experiments.fixed.stage import robot_stage

    assert all(robot_stage(load_robot(name)).listed for name in bundled_robots())
    robot = made_ready("test", str(arms.write_arm(tmp_path)), tmp_path / "out").robot
    assert not robot_stage(robot).listed
    good, bad = Check("a", "", "", True), Check("b", "", "", False)
    assert all_kept([good, bad._replace(counts=False)])
    assert not all_kept([good, bad])


@pytest.mark.slow
def test_the_command_says_what_it_chose_and_is_honest(arms: Any, tmp_path: Path) -> None:
    file, out = arms.write_arm(tmp_path, shapes=False), tmp_path / "out"
    words = ["demo", "fixed", "--robot", str(file), "--out", str(out), "--duration", "1", "--no-video"]
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        result = CliRunner().invoke(app, words)
    assert result.exit_code == 0, result.output
    for word in ("home posture chosen", "distance sensors put on its links", "motors for axis_1", "rods of"):
        assert word in " ".join(result.output.split())
    assert {"robot.toml", "spots.toml"} == {path.name for path in (out / "robot").iterdir()}
    assert CliRunner().invoke(app, ["replay", str(out / "run.npz")]).exit_code == 0
