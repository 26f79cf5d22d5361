"""A file that is edited between two campaigns of one process is read again; one that is edited in between is said."""

from __future__ import annotations

import importlib
import itertools
import os
import shutil
import sys
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import made_up_trials
import pytest

from qpsafe.errors import ConfigurationError
from qpsafe.robot.loader import load_robot
from qpsafe.sim.campaign.digests import State, robot_state, state_of
from qpsafe.sim.campaign.opponents import registry
from qpsafe.sim.campaign.opponents.registry import opponent, register
from qpsafe.sim.campaign.plan import Plan
from qpsafe.sim.campaign.runner import run_campaign, stored_results
from qpsafe.sim.campaign.trials.meeting import meeting
from qpsafe.sim.campaign.trials.play import packed
from qpsafe.sim.campaign.trials.station import station

CELL = '[[box]]\nname = "table"\nsize = [0.5, 0.9, 0.05]\ncentre = [0.9, {}.1, -0.3]\n'
PROGRAM = '[[segment]]\ndo = "dwell"\ntime = {}.5\n'
MAKER = '"""Of a user."""\nGAIN = {}.0\n\n\ndef make(station):\n    """So."""\n    return GAIN\n'
PERSON = '[[person]]\nname = "A"\nstart = [1.{}, 0.1]\n[[person.step]]\ndo = "walk"\nto = [0.5, 0.0]\nspeed = 1.0\n'


def cell(folder: Path) -> tuple[Path, str, Callable[[], object]]:
    file = folder / "cell.toml"
    return file, CELL, lambda: [o.vertices.tolist() for o in station("irb140", "hold", cell=str(file)).known]


def program(folder: Path) -> tuple[Path, str, Callable[[], object]]:
    file = folder / "program.toml"
    return file, PROGRAM, lambda: getattr(station("irb140", str(file)).program, "duration", None)


def person(folder: Path) -> tuple[Path, str, Callable[[], object]]:
    file = folder / "ada.toml"
    return file, PERSON, lambda: meeting(Plan(motions=("hold",), people=str(file)), 0).tracks.balls[0].tolist()


def stories(folder: Path) -> tuple[Path, str, Callable[[], object]]:
    (folder / "all").mkdir()
    plan = Plan(motions=("hold",), people=str(folder / "all"))
    return folder / "all" / "ada.toml", PERSON, lambda: meeting(plan, 0).tracks.balls[0].tolist()


def robot(folder: Path) -> tuple[Path, str, Callable[[], object]]:
    shutil.copytree(load_robot("irb140").folder, folder / "arm")
    file = folder / "arm" / "robot.toml"
    text = file.read_text(encoding="utf-8")
    text = text.replace("{", "{{").replace("}", "}}") + "# {}\n"
    return file, text, lambda: id(station(str(folder / "arm"), "hold"))


def maker(folder: Path) -> tuple[Path, str, Callable[[], object]]:
    file = folder / "mine.py"
    return file, MAKER, lambda: opponent(f"{file}:make").make(None)  # type: ignore[arg-type]


def module(folder: Path) -> tuple[Path, str, Callable[[], object]]:
    name = f"own_maker_{folder.name.replace('-', '_')}"
    sys.path.insert(0, str(folder))
    importlib.invalidate_caches()
    return folder / f"{name}.py", MAKER, lambda: opponent(f"{name}:make").make(None)  # type: ignore[arg-type]


@pytest.mark.parametrize("kind", [cell, program, person, stories, robot, maker, module])
def test_what_was_edited_is_read_again_and_what_was_not_is_kept(
    kind: Callable[[Path], tuple[Path, str, Callable[[], object]]], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """In the same second, to the same size."""
    monkeypatch.setattr(sys, "path", [*sys.path])
    file, text, read = kind(tmp_path)
    found = []
    for digit in (1, 2, 3, 1):
        file.write_text(text.format(digit), encoding="utf-8")
        found.append(read())
        assert read() == found[-1]
        time.sleep(0.01)  # a clock tick of the file system
    assert all(a != b for a, b in itertools.pairwise(found))
    if kind is not robot:
        assert found[0] == found[3]


def test_all_files_of_a_robot_count_wherever_they_lie(tmp_path: Path) -> None:
    """Its meshes too, and what a model includes."""
    (tmp_path / "meshes").mkdir()
    arm = tmp_path / "arm"
    shutil.copytree(load_robot("irb140").folder, arm)
    mesh = tmp_path / "meshes" / "part.obj"
    mesh.write_text("v 0 0 0\nv 0.1 0 0\nv 0 0.1 0\nv 0 0 0.1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n")
    model = arm / "robot.xml"
    text = model.read_text(encoding="utf-8")
    assets = '<asset><mesh name="part" file="part.obj"/></asset>'
    whole = text.replace("<worldbody>", f'<compiler meshdir="../meshes"/>{assets}<worldbody>', 1)
    assert whole != text
    model.write_text(whole, encoding="utf-8")
    before = robot_state(str(arm))
    named = {Path(os.path.realpath(path)) for path, _ in before}
    assert {arm / "robot.toml", model, arm / "spots.toml", mesh} <= named

    def touched(file: Path) -> State:
        time.sleep(0.01)
        os.utime(file)
        return robot_state(str(arm))

    states = [before, *map(touched, (mesh, model, arm / "spots.toml", arm / "robot.toml"))]
    assert len(set(states)) == len(states)
    assert robot_state("irb140") == ()


def test_a_state_is_of_files_that_are_there_or_not(tmp_path: Path) -> None:
    names = [str(tmp_path / "none.toml"), "\0", "ä" * 5000, "/dev/null/x"]
    assert [stamp for _, stamp in state_of(*names, None)] == [None] * 4


def test_blocks_of_a_controller_are_not_those_of_another_that_had_its_name(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    place = station("irb140", "hold")
    found = []
    for gate in ("off", "on"):
        monkeypatch.setattr(registry, "_known", dict(registry._known))
        registry._known.pop("mine", None)
        register("mine", lambda place, gate=gate: place.controller() if gate == "on" else place.controller(gate="off"))
        found.append(packed(place, opponent("mine")))
        assert packed(place, opponent("mine")) is found[-1]
    assert found[0] is not found[1]


def test_a_file_that_is_edited_while_trials_are_played_is_said(tmp_path: Path, people: str) -> None:
    """Nobody knows whose the last trials are: they are not kept, those before are."""
    mine = tmp_path / "ada.toml"
    shutil.copy(people, mine)
    plan = Plan(trials=12, controllers=("none", "stop"), people=str(mine))

    def editing(plan: Plan, trial: int) -> list[dict[str, Any]]:
        if trial == 6:
            mine.write_text(mine.read_text() + "# edited\n")
        return made_up_trials.run(plan, trial)

    with pytest.raises(ConfigurationError, match=r"kept: files = .*not kept"):
        run_campaign(plan, tmp_path / "kept", trial=editing, keep_every=0.0)
    assert stored_results(tmp_path / "kept").trials == 4
    with pytest.raises(ConfigurationError, match=r"files = .*do not mix"):
        run_campaign(plan, tmp_path / "kept", trial=made_up_trials.run)


def test_a_plan_is_the_same_wherever_its_files_lie(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Paths of the command line are relative; the folder can be reported, and gone on with, from anywhere."""
    for name in ("here", "there"):
        (tmp_path / name).mkdir()
        (tmp_path / name / "ada.toml").write_text(PERSON.format(3))
    monkeypatch.chdir(tmp_path / "here")
    plan = Plan(trials=4, controllers=("none", "stop"), people="ada.toml")
    run_campaign(plan, tmp_path / "kept", trial=made_up_trials.run)
    monkeypatch.chdir(tmp_path)
    stored = stored_results(tmp_path / "kept").plan
    assert stored.people == str(tmp_path / "here" / "ada.toml")
    assert stored.digest() == replace(plan, people="there/ada.toml").digest()
    run_campaign(replace(stored, trials=6), tmp_path / "kept", trial=made_up_trials.run)
    assert stored_results(tmp_path / "kept").trials == 6
