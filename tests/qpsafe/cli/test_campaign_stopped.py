"""`qpsafe campaign`, killed and interrupted, goes on to the same report."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

import made_up_trials
import pytest
from made_up_trials import without_times

from qpsafe.sim.campaign.runner import stored_results

Campaign = Callable[..., Any]


SCRIPT = """
import sys
import made_up_trials
from qpsafe.sim.campaign import runner
runner._engine = lambda: made_up_trials.run_slowly
runner.KEEP_EVERY = 0.1
runner.run_campaign.__kwdefaults__["keep_every"] = 0.1
from qpsafe.cli.main import main
if __name__ == "__main__":
    main()
"""
LONG = ["campaign", "--trials", "400", "--workers", "2", "--controllers", "none,stop,default", "--out"]


def began(folder: Path, until_kept: bool = True) -> subprocess.Popen[str]:
    """A campaign of 400 trials in a Python of its own, which has kept some."""
    script = folder.parent / "campaign.py"
    script.write_text(SCRIPT)
    environment = os.environ | {"PYTHONPATH": str(Path(made_up_trials.__file__).parent), "NO_COLOR": "1"}
    options = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True, "start_new_session": True}
    command = [sys.executable, str(script), *LONG, str(folder)]
    process = subprocess.Popen(command, env=environment, **options)  # type: ignore[call-overload]
    limit = time.monotonic() + 60
    while until_kept and not list(folder.glob("*.parquet")):
        assert process.poll() is None, process.communicate()
        assert time.monotonic() < limit
        time.sleep(0.02)
    return process


def all_end(group: int) -> None:
    """Wait until no process of a group is left: they end by themselves."""
    limit = time.monotonic() + 20
    with suppress(ProcessLookupError):
        while True:
            os.killpg(group, 0)
            assert time.monotonic() < limit
            time.sleep(0.05)


def reports(folder: Path) -> list[str]:
    return [without_times((folder / name).read_text(encoding="utf-8")) for name in ("report.json", "report.html")]


@pytest.mark.slow
def test_killed_and_interrupted_it_goes_on_to_the_same_report_byte_for_byte_but_for_times(
    campaign: Campaign, tmp_path: Path
) -> None:
    folder = tmp_path / "kept"
    process = began(folder)
    process.kill()  # signal 9, in the middle
    process.communicate()
    all_end(process.pid)
    first = stored_results(folder).trials
    assert 0 < first < 400
    process = began(folder)
    while stored_results(folder).trials == first:
        time.sleep(0.05)
    os.killpg(process.pid, signal.SIGINT)  # Ctrl-C, as a terminal does: to all processes
    out, errors = process.communicate(timeout=20)
    assert process.returncode == 130
    assert "Traceback" not in out + errors
    assert f"finished trials are kept in {folder}: the same command goes on there" in " ".join(out.split())
    assert "interrupted" in errors
    all_end(process.pid)
    assert first < stored_results(folder).trials < 400
    process = began(folder, until_kept=False)
    out, errors = process.communicate(timeout=120)
    assert process.returncode == 0, out + errors
    straight = campaign(*LONG[1:3], "--workers", "1", *LONG[5:], "straight")
    assert straight.exit_code == 0
    assert reports(folder) == reports(tmp_path / "straight")
