"""The fault matrix holds, and would say so if it did not."""

from __future__ import annotations

import json
import multiprocessing
import os
import signal

import numpy as np
import pytest
from typer.testing import CliRunner

from qpsafe.cli.main import app
from qpsafe.errors import QpsafeError
from qpsafe.irc5.session import EgmSession
from qpsafe.robot.loader import load_robot
from qpsafe.sim.irc5.bench import Workbench
from qpsafe.sim.irc5.fault_cases import CASES
from qpsafe.sim.irc5.fault_matrix import run_faults

pytestmark = pytest.mark.long

QUICK = (
    "junk after every packet",
    "motors off for 0.4 s",
    "NaN for a joint, 40 ms",
    "seven joints, 40 ms",
    "packets lost for 0.3 s",
    "Ctrl-C",
)


def test_a_copy_goes_on_as_the_original() -> None:
    bench = Workbench(load_robot("irb140"))
    for _ in range(200):
        bench.turn()
    copy = bench.copy()
    for _ in range(50):
        a, b = bench.turn(), copy.turn()
        assert (a.q == b.q).all()
        assert (a.state, a.counts) == (b.state, b.counts)
    copy.irc5.motors(False)
    copy.turn()
    assert bench.turn().ready


def test_some_faults_at_one_moment() -> None:
    cases = [case for case in CASES if case.name in QUICK]
    results = run_faults(load_robot("irb140"), 1, seed=3, latest=300, cases=cases)
    assert len(results) == len(QUICK)
    assert [result.case for result in results if not result.kept] == []


@pytest.mark.slow
def test_the_matrix_sees_a_broken_streamer(monkeypatch: pytest.MonkeyPatch) -> None:
    """One that drives the robot whatever its states are, and one that raises."""
    cases = [case for case in CASES if case.name == "motors off for 0.4 s"]
    monkeypatch.setattr(EgmSession, "_closed", lambda self, packet: [])
    (result,) = run_faults(load_robot("irb140"), 1, seed=3, latest=300, cases=cases)
    assert not result.kept
    assert result.seen == 0

    def broken(*_: object) -> None:
        raise RuntimeError("streamer on fire")

    jump = [case._replace(start=lambda bench: monkeypatch.setattr(EgmSession, "offer", broken)) for case in cases]
    (result,) = run_faults(load_robot("irb140"), 1, seed=3, latest=300, cases=jump)
    assert not result.kept
    assert "on fire" in result.errors[0]


@pytest.mark.slow
@pytest.mark.skipif("fork" not in multiprocessing.get_all_start_methods(), reason="processes that inherit the work")
def test_a_worker_that_dies_is_told_and_the_moments_agree_with_those_of_one_process() -> None:
    (case,) = (case for case in CASES if case.name == "Ctrl-C")
    robot = load_robot("irb140")
    alone, beside = (run_faults(robot, 2, seed=3, latest=210, cases=[case], jobs=jobs) for jobs in (1, 2))
    assert alone == beside
    dies = case._replace(start=lambda bench: os.kill(os.getpid(), signal.SIGKILL))
    with pytest.raises(QpsafeError, match="worker process died"):
        run_faults(robot, 2, seed=3, latest=210, cases=[dies], jobs=2)


@pytest.mark.slow
def test_the_whole_matrix_by_the_command_line() -> None:
    result = CliRunner().invoke(app, ["irc5-faults", "--moments", "3", "--jobs", "1", "--json"])
    report = json.loads(result.stdout)
    assert [case["case"] for case in report["cases"] if not case["kept"]] == []
    assert report["good"] is True
    assert result.exit_code == 0
    assert len(report["cases"]) == len(CASES) >= 25
    assert max(case["change"] for case in report["cases"]) <= 1.0 + 1e-6
    assert all(np.isfinite(case["step"]) for case in report["cases"])
