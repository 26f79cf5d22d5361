"""Every sick-sensor case in closed loop: a small version here, the whole matrix when there is time."""

import json
import math
from contextlib import nullcontext
from types import SimpleNamespace

import pytest
import typer
from amounts import first, some
from typer.testing import CliRunner

import qpsafe
from qpsafe.errors import ConfigurationError
from qpsafe.sim.experiments.fixed.experiment import FixedExperiment
from qpsafe.sim.experiments.fixed.fixed_loop import FixedLoop
from qpsafe.sim.people.choreography import Approach, Choreography
from qpsafe.sim.sick.cases import CASES
from qpsafe.sim.sick.matrix import Result, run_matrix

pytestmark = pytest.mark.long

ROBOT = qpsafe.load_robot("irb140")
BRIEF = Choreography(
    approaches=(Approach(math.radians(0.0), 0.0, 1.02, 0.72, medium_pause=0.2, close_pause=0.2),),
    duration=5.0,
    home_radius=1.7,
    approach_speed=0.9,
    withdraw_speed=0.9,
)


@pytest.mark.slow
def test_a_copy_goes_on_as_the_run_does_bit_by_bit():
    for sensor in ("ideal", "sharp"):
        loop = FixedLoop(FixedExperiment(ROBOT, sensor=sensor, choreography=BRIEF))
        for _ in range(200):
            loop.step()
            loop.advance()
        twin = loop.copy()
        for _ in range(60):
            one, other = loop.step(), twin.step()
            assert one.tick.reference.q.tobytes() == other.tick.reference.q.tobytes()
            assert one.distances.tobytes() == other.distances.tobytes()
            loop.advance()
            twin.advance()


@pytest.mark.parametrize("wrong", [{"contacts": 1}, {"passed": 1e-3}])
def test_a_case_that_could_show_at_no_moment_is_not_kept_nor_excused(wrong, capsys):
    """Nothing was tried, so nothing was kept; a contact or a limit passed counts all the same."""
    from qpsafe.cli.common import console, show_matrix
    from qpsafe.cli.sensors.sick_sensors import show

    untried = Result("stuck", "reported", 1, 1, 0, 0, 0, 0, 0.0, 0.2, 0.2)
    broken = untried._replace(**wrong)
    assert untried.kept is None
    assert broken.kept is False
    show_matrix([untried], show, console(False), as_json=False)
    assert "not tried" in capsys.readouterr().out
    show_matrix([untried], show, console(True), as_json=True)
    assert json.loads(capsys.readouterr().out)["cases"][0]["kept"] is None
    with pytest.raises(typer.Exit):
        show_matrix([untried, broken], show, console(False), as_json=False)
    assert "NOT" in capsys.readouterr().out


def test_every_case_reacts_as_promised():
    cases = CASES[:: some(3, of=1)]
    experiment = FixedExperiment(ROBOT, choreography=BRIEF, duration=5.0)
    results = run_matrix(experiment, count=1, seed=4, cases=cases, jobs=1)
    assert [result.case for result in results] == [case.name for case in cases]
    for result in results:
        assert result.kept is (True if result.applied else None), result
    assert sum(result.applied for result in results) >= len(results) - 1  # the moment is one where all can show


@pytest.mark.slow
@pytest.mark.parametrize("sensor", ["ideal", "sharp"])
def test_every_case_at_20_moments(sensor):
    for result in run_matrix(FixedExperiment(ROBOT, sensor=sensor), count=20, jobs=2):
        assert result.kept, result


@pytest.mark.slow
def test_the_first_experiment_keeps_its_promises_with_sharp_sensors():
    from qpsafe.sim.experiments.shared.report import summarise

    for seed in (0, 3):
        experiment = FixedExperiment(ROBOT, sensor="sharp", seed=seed)
        log = experiment.run()
        report = summarise(log, experiment.board_distance_without_controller(), experiment.windows(), ROBOT)
        assert report.kept, [check for check in report.checks if not check.kept]
        assert set(log.status) == {"ok"}


@pytest.mark.parametrize(("count", "expected"), first(1, [(2, [2]), (1, [])]))
def test_there_are_never_more_processes_than_moments(count, expected, monkeypatch):
    asked = []

    class Forked(Exception):
        pass

    def pool(jobs, **_):
        asked.append(jobs)
        raise Forked

    monkeypatch.setattr("multiprocessing.get_context", lambda kind: SimpleNamespace(Pool=pool))
    monkeypatch.setattr("qpsafe.sim.sick.matrix.at_moment", lambda *task: [])
    experiment = FixedExperiment(ROBOT, choreography=BRIEF, duration=5.0)
    with pytest.raises(Forked) if expected else nullcontext():
        run_matrix(experiment, count=count, seed=4, cases=(), jobs=10**20)
    assert asked == expected


def test_where_no_sensor_can_fall_sick_nothing_is_run():
    with pytest.raises(ConfigurationError, match=r"run_matrix: sensor = 'perfect'.*sensors that can fall sick"):
        run_matrix(FixedExperiment(ROBOT, sensor="perfect", choreography=BRIEF), count=1, jobs=1)


@pytest.mark.parametrize("sensor", ["perfect", "foo", "", "perfect+depth"])
def test_the_command_refuses_other_sensors_before_it_begins(sensor, monkeypatch):
    from qpsafe.cli.main import app

    monkeypatch.setattr("qpsafe.cli.sensors.sick_sensors.progress_bar", lambda screen: pytest.fail("it has begun"))
    result = CliRunner().invoke(app, ["sick-sensors", "--sensor", sensor])
    assert isinstance(result.exception, ConfigurationError)
    assert str(result.exception).startswith(f"qpsafe sick-sensors: --sensor = {sensor!r}")
