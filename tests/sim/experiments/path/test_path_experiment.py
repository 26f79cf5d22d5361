"""The paper's second experiment, shortened: one approach from the front while the tool follows its line."""

import json
from dataclasses import fields, replace
from pathlib import Path

import numpy as np
import pytest

import qpsafe
from qpsafe.errors import ConfigurationError
from qpsafe.recovery.recovery import RecoveryRules
from qpsafe.sim.experiments.path.experiment import PathExperiment, PathRun
from qpsafe.sim.experiments.path.plots import side_by_side
from qpsafe.sim.experiments.path.report import figures, on_line, promises, returning, to_dict
from qpsafe.sim.people.choreography import Approach, Choreography

pytestmark = pytest.mark.long

ROBOT = qpsafe.load_robot("irb140")
APPROACH = Approach(0.0, start=3.0, medium_distance=0.88, close_distance=0.72, medium_pause=0.3, close_pause=0.5)
SHORT = Choreography((APPROACH,), duration=12.0, home_radius=1.8)


@pytest.fixture(scope="module")
def strict() -> PathRun:
    return PathExperiment(ROBOT, choreography=SHORT, duration=11.0).run_path()


@pytest.fixture(scope="module")
def without() -> PathRun:
    """The same without suspension and recovery."""
    rules = RecoveryRules(enabled=False)
    return PathExperiment(ROBOT, choreography=SHORT, duration=11.0, recovery=rules).run_path()


@pytest.fixture(scope="module")
def nullspace() -> PathRun:
    """Up to where the person comes."""
    return PathExperiment(ROBOT, qpsafe.NullspaceLaw(), choreography=SHORT, duration=2.5).run_path()


def test_the_run_has_every_regime_and_phase(strict: PathRun) -> None:
    assert set(strict.log.regime) == {"low", "medium", "high"}
    assert set(strict.log.phase) == {"following", "suspended", "recovering"}
    assert not strict.log.messages
    assert on_line(strict).sum() > 200
    assert strict.speed.max() == pytest.approx(0.1, rel=1e-6)


@pytest.mark.slow
def test_orientation_error_vanishes_with_strict_and_stays_with_the_null_space_law(
    strict: PathRun, nullspace: PathRun
) -> None:
    """On the line in low danger at constant speed; the paper reports the latter in its section VI-B."""
    assert figures(strict, ROBOT).line_orientation < 1e-4
    assert figures(nullspace, ROBOT).line_orientation > 1e-2


def test_the_line_is_kept_in_medium_danger(strict: PathRun) -> None:
    assert figures(strict, ROBOT).medium_position < 2e-3


@pytest.mark.slow
def test_no_joint_speed_jumps(strict: PathRun, without: PathRun, nullspace: PathRun) -> None:
    for run in (strict, without, nullspace):
        assert figures(run, ROBOT).step <= 1.0 + 1e-9


def test_the_path_goes_on_within_a_millimetre_of_where_it_stopped(strict: PathRun) -> None:
    found = figures(strict, ROBOT)
    assert found.suspensions >= 1
    assert found.resumed < 1e-3
    moving = np.diff(strict.path_time) > 0.0
    assert (strict.log.phase[1:][moving] == "following").all()  # the clock runs only while the path is followed
    assert (np.diff(strict.path_time) >= 0.0).all()
    rest = strict.log.phase[1:] != "following"
    assert (np.diff(strict.origin, axis=0)[rest] == 0.0).all()


@pytest.mark.slow
def test_recovery_is_gentler_than_none(strict: PathRun, without: PathRun) -> None:
    recovered, pulled = figures(strict, ROBOT), figures(without, ROBOT)
    assert returning(strict).any()
    assert returning(without).any()
    assert recovered.return_speed < 0.6 * pulled.return_speed
    assert recovered.return_acceleration <= RecoveryRules().acceleration + 1e-9
    assert pulled.return_acceleration > 0.9
    assert recovered.smooth_acceleration < pulled.smooth_acceleration


@pytest.mark.slow
def test_the_report_names_what_is_not_kept(strict: PathRun, without: PathRun, nullspace: PathRun) -> None:
    found = {name: figures(run, ROBOT) for name, run in (("a", strict), ("b", without), ("c", nullspace))}
    checks, left_out = promises(found["a"], found["b"], {"nullspace": found["c"]})
    assert all(check.kept for check in checks), checks
    assert not left_out
    worse = replace(found["a"], step=1.1, resumed=2e-3, line_orientation=float("nan"))
    broken = [check.name for check in promises(worse, found["b"], {"nullspace": found["c"]})[0] if not check.kept]
    assert len(broken) == 3
    report = to_dict(found, *promises(worse, None, {}))
    assert not report["kept"]
    assert json.loads(json.dumps(report, allow_nan=False)) == report


def cut(run: PathRun, ticks: int) -> PathRun:
    """The beginning of a run."""
    n = len(run.log.time)
    parts = {
        field.name: value[:ticks] if isinstance(value, np.ndarray) and len(value) == n else value
        for field in fields(run.log)
        for value in [getattr(run.log, field.name)]
    }
    parts["messages"] = tuple(message for message in run.log.messages if message[0] < ticks)
    return PathRun(type(run.log)(**parts), run.path_time[:ticks], run.speed[:ticks], run.origin[:ticks])


@pytest.mark.slow
@pytest.mark.parametrize("ticks", [2, 30, 250, *range(525, 2750, 150), 2750])
def test_a_shorter_run_leaves_promises_out_and_breaks_none(
    strict: PathRun, without: PathRun, nullspace: PathRun, ticks: int
) -> None:
    """However early a good run ends: what did not happen is named, the rest is kept, nothing is both or neither."""
    short = [figures(cut(run, ticks), ROBOT) for run in (strict, without, nullspace)]
    checks, left_out = promises(short[0], short[1], {"nullspace": short[2]})
    broken = [check for check in checks if not check.kept]
    assert not broken
    assert not [check for check in checks if "nan" in " ".join(check[1:3])]
    names = [*(check.name for check in checks), *left_out]
    assert len(set(names)) == len(names) == 9


def test_the_figure_is_drawn(strict: PathRun, tmp_path: Path) -> None:
    part = cut(strict, 1500)
    side_by_side({"strict": part, "again": part}, ROBOT, tmp_path / "figure.png")
    assert (tmp_path / "figure.png").read_bytes().startswith(b"\x89PNG")


def test_a_program_out_of_reach_is_refused_before_it_runs(tmp_path: Path) -> None:
    path = tmp_path / "far.toml"
    path.write_text(
        'start = "a"\n[points]\na = { position = [2.0, 0.0, 0.5] }\n[[segment]]\ndo = "dwell"\ntime = 1.0\n'
    )
    with pytest.raises(ConfigurationError, match=r"far\.toml:1: start"):
        PathExperiment(ROBOT, program=path).run_path()
