"""A run's file gives the run back bit by bit, and nothing that was changed in it passes."""

from __future__ import annotations

import json
import shutil
import zipfile
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from amounts import first, some
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st

import qpsafe
from qpsafe.cli.main import app
from qpsafe.errors import ConfigurationError
from qpsafe.sim.experiments.encounter import encounter
from qpsafe.sim.experiments.fixed.experiment import FixedExperiment
from qpsafe.sim.experiments.path.experiment import PathExperiment
from qpsafe.sim.experiments.pick_place.experiment import PickPlaceExperiment
from qpsafe.sim.experiments.pick_place.settings import PEOPLE
from qpsafe.sim.people.choreography import Approach, Choreography
from qpsafe.sim.recording.run_file import (
    CODE,
    INPUTS,
    OUTPUTS,
    PRINT,
    RunFile,
    RunFileError,
    StateRecorder,
    _digest,
    read_run,
    write_run,
)
from qpsafe.sim.replay.replay import changed, replay
from qpsafe.sim.replay.settings import experiment_of, settings_of
from qpsafe.sim.replay.stage import Stage
from qpsafe.sim.stories.file import parse_story
from qpsafe.sim.world.distance import TrueDistances

pytestmark = pytest.mark.long

ROBOT = qpsafe.load_robot("irb140")
NEAR = """
[[person]]
name = "A"
start = [1.9, 0.1]
heading = 180.0

[[person.step]]
do = "walk"
to = [0.5, 0.0]
speed = 2.0
ease = 0.3
"""
TICKS = 350


@pytest.fixture(scope="module", params=first(1, ["ideal", "sharp"]))
def recorded(request, tmp_path_factory) -> tuple[Path, FixedExperiment, object]:
    """Somebody walks into the robot; sensors are noisy, so that all kinds of answers occur."""
    experiment = FixedExperiment(ROBOT, story=parse_story(NEAR), duration=TICKS * 0.004, sensor=request.param, lag=0.01)
    path, states = tmp_path_factory.mktemp("run") / "run.npz", StateRecorder()
    log = experiment.run(states.observe)
    write_run(path, log, settings_of(experiment), ROBOT, states)
    return path, experiment, log


@pytest.fixture(scope="module")
def run(recorded) -> RunFile:
    return read_run(recorded[0])


def test_what_was_written_is_read(recorded, run: RunFile) -> None:
    _, experiment, log = recorded
    for name in (*INPUTS, *OUTPUTS):
        a, b = run.arrays[name], getattr(log, name)
        assert a.dtype == b.dtype
        assert a.tobytes() == b.tobytes(), name
    assert run.ticks == TICKS
    assert run.header["spots"] == list(log.spot_names)
    assert settings_of(experiment_of(run.header["settings"])) == settings_of(experiment)


def test_replay_gives_every_bit_again(run: RunFile) -> None:
    found = replay(run)
    assert found.same, found
    assert (found.ticks, found.different, found.largest, found.changed) == (TICKS, 0, 0.0, ())
    assert {"low", "high"} <= set(run.arrays["regime"])


@given(st.integers(0, TICKS - 1), st.integers(0, 5), st.integers(0, 63), st.sampled_from(["q_ref", "qd_ref"]))
@example(k=0, joint=1, bit=63, name="qd_ref")  # 0.0 becomes -0.0
@settings(max_examples=some(1, of=3), deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_one_flipped_bit_of_an_answer_is_found_with_its_tick(run: RunFile, k, joint, bit, name) -> None:
    flipped = run.arrays[name].copy()
    flipped.view(np.uint64)[k, joint] ^= np.uint64(1 << bit)
    found = replay(replace(run, arrays={**run.arrays, name: flipped}))
    assert (found.different, found.first.tick, found.first.what) == (1, k, f"{name}[{joint}]")
    assert found.first.time == pytest.approx(k * 0.004)


def test_another_input_gives_other_answers_from_then_on(run: RunFile) -> None:
    distances = run.arrays["distances"].copy()
    k = int(np.flatnonzero(np.isfinite(distances).any(axis=1))[50])
    spot = int(np.flatnonzero(np.isfinite(distances[k]))[0])
    distances[k, spot] *= 0.9
    found = replay(replace(run, arrays={**run.arrays, "distances": distances}))
    assert found.first is not None
    assert found.first.tick >= k
    assert found.largest > 0.0


def test_other_words_and_messages_are_found(run: RunFile) -> None:
    words = run.arrays["phase"].astype("U20")
    words[7] = "recovering"
    found = replay(replace(run, arrays={**run.arrays, "phase": words}))
    assert (found.first.tick, found.first.what, found.first.recorded) == (7, "phase", "recovering")
    header = {**run.header, "messages": [[11, "a ghost"], *run.header["messages"]]}
    found = replay(replace(run, header=header))
    assert (found.first.tick, found.first.what) == (11, "messages")


@pytest.mark.slow
def test_other_versions_and_robot_files_are_named(run: RunFile) -> None:
    versions = {**run.header["versions"], "numpy": "1.2.3"}
    found = replay(replace(run, header={**run.header, "versions": versions, "robot_files": PRINT + "0"}))
    assert found.same
    assert found.changed[0] == f"numpy 1.2.3 then, {np.__version__} now"
    assert "robot irb140" in found.changed[1]


def test_every_file_that_decides_is_named_wherever_it_lies_and_no_other(tmp_path: Path) -> None:
    """A robot's folder whose model lies elsewhere, with sensors from a third place."""
    folder, elsewhere = tmp_path / "robot", tmp_path / "elsewhere"
    shutil.copytree(ROBOT.folder, folder)
    elsewhere.mkdir()
    model = elsewhere / "model.xml"
    shutil.move(folder / ROBOT.model_path.name, model)
    toml, spots = folder / "robot.toml", elsewhere / "mine.toml"
    text = toml.read_text(encoding="utf-8")
    toml.write_text(text.replace(f'model = "{ROBOT.model_path.name}"', f"model = {json.dumps(str(model))}"), "utf-8")
    shutil.copy(folder / "spots.toml", spots)
    experiment = FixedExperiment(qpsafe.load_robot(folder).with_spots(spots), duration=0.008)
    write_run(tmp_path / "run.npz", experiment.run(), settings_of(experiment), experiment.robot)
    run = read_run(tmp_path / "run.npz")

    def said() -> tuple[str, ...]:
        return changed(run, experiment)

    assert said() == ()
    for path, more in ((toml, "# x\n"), (model, "<!-- x -->"), (spots, "# x\n"), (folder / "spots.toml", "# x\n")):
        before = path.read_bytes()
        path.write_bytes(before + more.encode())
        assert said() == ("the files of robot irb140 have changed",), path
        path.write_bytes(before)
    for name in ("cell.toml", "other.xml", "run.urdf"):
        (folder / name).write_text("x", encoding="utf-8")
    assert said() == ()
    older = replace(run, header={**run.header, "robot_files": 64 * "0"})
    assert changed(older, experiment) == ()
    noted = run.header["versions"]
    for versions, words in (
        ({**noted, CODE: "0" * 12}, f"{CODE} {'0' * 12} then, {noted[CODE]} now"),
        ({name: was for name, was in noted.items() if name != CODE}, f"the {CODE} was not noted then"),
    ):
        assert changed(replace(run, header={**run.header, "versions": versions}), experiment) == (words,)


def test_recorded_states_are_those_of_the_run(recorded, run: RunFile) -> None:
    _, experiment, log = recorded
    stage = Stage(run, experiment)
    assert not stage.show(1)
    for k in (0, 10, 300):
        assert stage.show(k)
        assert np.array_equal(stage.q, log.q[k])
        poses = experiment.walk.poses(k * log.dt)
        for geom, place in zip(stage.scene.person_geoms, poses[0].positions, strict=True):
            assert stage.data.geom_xpos[geom] == pytest.approx(place, abs=1e-12)


@pytest.mark.parametrize("where", [0.02, 0.3, 0.6, 0.9, 0.999])
def test_damage_anywhere_in_the_file_is_an_error_or_changes_nothing(
    recorded, run: RunFile, tmp_path: Path, where
) -> None:
    content = bytearray(recorded[0].read_bytes())
    content[int(where * len(content))] ^= 0x10
    (tmp_path / "bad.npz").write_bytes(content)
    try:
        found = read_run(tmp_path / "bad.npz")
    except RunFileError as error:
        assert "bad.npz: " in str(error)  # noqa: PT017
    else:  # such as the time of an entry of the archive
        assert all(
            np.array_equal(a, found.arrays[name], equal_nan=a.dtype.kind == "f") for name, a in run.arrays.items()
        )


@pytest.mark.parametrize("share", [0.0, 0.1, 0.5, 0.99])
def test_a_file_cut_short_is_an_error(recorded, tmp_path: Path, share: float) -> None:
    content = recorded[0].read_bytes()
    (tmp_path / "short.npz").write_bytes(content[: int(share * len(content))])
    with pytest.raises(RunFileError, match=r"short\.npz: "):
        read_run(tmp_path / "short.npz")


def test_a_changed_array_is_not_as_it_was_written(recorded, tmp_path: Path) -> None:
    """Written anew with a sound checksum of its own, yet another value."""
    with np.load(recorded[0]) as archive:
        arrays = {name: archive[name] for name in archive.files}
    arrays["q"][100, 0] += 1e-9
    np.savez(tmp_path / "forged.npz", **arrays)
    with pytest.raises(RunFileError, match="not as it was written"):
        read_run(tmp_path / "forged.npz")


@pytest.mark.parametrize("lies", [False, True])
def test_a_small_file_that_expands_to_a_huge_one_is_refused_unread(
    tmp_path: Path, lies: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Whether the archive states the size, or only an array in it claims to be large."""
    monkeypatch.setattr("qpsafe.sim.recording.run_file.LARGEST", 2**22)
    path = tmp_path / "bomb.npz"
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        for name in ("header", "q"):
            with archive.open(f"{name}.npy", "w") as file:
                shape = {"descr": "<f8", "fortran_order": False, "shape": (10**9,)}
                np.lib.format.write_array_header_1_0(file, shape)
                file.write(bytes(2**20 if lies else 2**23))
    assert path.stat().st_size < 2**16
    with pytest.raises(RunFileError, match=r"bomb\.npz: " if lies else "expand to 16 MiB; a run has at most 4 MiB"):
        read_run(path)


@pytest.mark.parametrize("key", ["settings", "versions", "messages", "spots", "dt", "robot_files", "digest", "format"])
@pytest.mark.parametrize("value", [None, [], [[1]], [[{}, "a"]], {}, "a", 7, 10**400])
def test_a_header_of_other_kinds_is_refused(recorded, tmp_path: Path, key: str, value: Any) -> None:
    """With a digest that fits: only what the header says is wrong."""
    with np.load(recorded[0]) as archive:
        arrays = {name: archive[name] for name in archive.files}
    header = {**json.loads(str(arrays.pop("header"))), key: value}
    if key != "digest":
        header["digest"] = _digest(header, arrays)
    np.savez(tmp_path / "other.npz", header=np.array(json.dumps(header)), **arrays)
    try:
        read_run(tmp_path / "other.npz").messages()
    except RunFileError:
        return
    assert isinstance(value, {"settings": dict, "versions": dict, "messages": list, "spots": list}.get(key, str))


@pytest.mark.parametrize("content", [b"", b"hello", b"\x93NUMPY\x01\x00", b"PK\x03\x04 no archive"])
def test_other_files_are_refused(tmp_path: Path, content: bytes) -> None:
    (tmp_path / "other.npz").write_bytes(content)
    with pytest.raises(RunFileError, match=r"other\.npz: "):
        read_run(tmp_path / "other.npz")
    with pytest.raises(RunFileError, match="no such file"):
        read_run(tmp_path / "nowhere.npz")
    np.save(tmp_path / "array.npy", np.zeros(3))
    with pytest.raises(RunFileError, match="not a run"):
        read_run(tmp_path / "array.npy")
    np.savez(tmp_path / "plain.npz", a=np.zeros(3))
    with pytest.raises(RunFileError, match="no header"):
        read_run(tmp_path / "plain.npz")
    np.savez(tmp_path / "future.npz", header=np.array(json.dumps({"format": "qpsafe run", "version": 99})))
    with pytest.raises(RunFileError, match="version 99"):
        read_run(tmp_path / "future.npz")


@pytest.mark.parametrize(
    "experiment",
    [
        FixedExperiment(ROBOT, qpsafe.WeightedLaw(200.0), seed=4, limits=False, cap=15.0, duration=7.0),
        FixedExperiment(ROBOT, choreography=Choreography((Approach(0.3, 1.0, 0.9, 0.8),))),
        FixedExperiment(ROBOT.with_spots("spots-by-hand.toml"), duration=1.0),
        FixedExperiment(ROBOT, qpsafe.NullspaceLaw(), rules=qpsafe.SensingRules(hold_time=0.3)),
        PathExperiment(ROBOT, qpsafe.HierarchicalLaw("paper"), recovery=qpsafe.RecoveryRules(enabled=False)),
    ],
)
def test_settings_survive_json(experiment: FixedExperiment) -> None:
    found = settings_of(experiment)
    again = experiment_of(json.loads(json.dumps(found)))
    assert type(again) is type(experiment)
    assert json.dumps(settings_of(again)) == json.dumps(found)
    assert again.robot.spots_path == experiment.robot.spots_path
    for t in (0.0, 3.0, 6.0):
        for a, b in zip(experiment.walk.poses(t), again.walk.poses(t), strict=True):
            assert np.array_equal(a.ends, b.ends)
        assert np.array_equal(experiment.reference.sample(t).pose, again.reference.sample(t).pose)


@pytest.mark.slow
@pytest.mark.parametrize("people", [PEOPLE, None])
def test_the_third_experiment_is_recorded_and_replayed_too(tmp_path: Path, people: Path | None) -> None:
    experiment = PickPlaceExperiment(ROBOT, people_file=people, seed=3, limit=0.4)
    states = StateRecorder()
    log = experiment.run(states.observe).log
    write_run(tmp_path / "run.npz", log, settings_of(experiment), ROBOT, states)
    run = read_run(tmp_path / "run.npz")
    again = experiment_of(run.header["settings"])
    assert settings_of(again) == settings_of(experiment)
    assert replay(run, experiment=again).same
    stage = Stage(run, again)  # screws and people are where they were
    assert stage.show(0)
    assert stage.data.qpos.shape == (experiment.scene.model.nq,)


def test_a_law_of_ones_own_cannot_be_recorded() -> None:
    class Own(qpsafe.NullspaceLaw.__base__):  # type: ignore[misc, name-defined]
        pass

    with pytest.raises(ConfigurationError, match="a bundled law"):
        settings_of(FixedExperiment(ROBOT, Own()))


def test_encounter_says_what_the_log_shows(recorded) -> None:
    """Somebody at 2 m/s touches the robot while it retreats."""
    _, experiment, log = recorded
    near = encounter(log, experiment)
    gap = np.minimum(log.person_distance, log.board_distance)
    assert near.distance == gap.min()
    assert (near.contact is None) == bool(gap.min() > 0.0)
    away = replace(log, person_distance=log.person_distance + 1.0)
    assert encounter(away, experiment).contact is None
    assert "no contact" in encounter(away, experiment).sentence()
    touching = replace(log, person_distance=log.person_distance - 5.0)
    assert encounter(touching, experiment).contact == 0.0
    assert encounter(touching, experiment).moving_contact <= 1.5
    assert "CONTACT at 0.00 s" in encounter(touching, experiment).sentence()


def test_the_speed_towards_somebody_is_that_of_the_gap_if_they_stood_still(recorded) -> None:
    """One tick before contact; positive where the robot comes nearer, whatever the person does."""
    _, experiment, log = recorded
    scene, gaps = experiment.scene, TrueDistances(experiment.scene)
    fastest = np.linalg.norm(log.qd[:-1], axis=1).argsort()[-150::30]
    found = []
    for k in map(int, fastest):
        gap = np.where(np.arange(len(log.time)) > k, -1.0, 1.0)  # contact at the tick after k
        found.append(encounter(replace(log, person_distance=gap), experiment).towards_speed)
        measured = []
        for sign in (1.0, -1.0):
            data = scene.make_data(log.q[k] + sign * 1e-5 * log.qd[k])
            scene.place_people(data, [person.pose(k * log.dt) for person in experiment.walk.people])
            measured.append(min(near.distance for near in gaps.measure(data)))
        assert found[-1] == pytest.approx((measured[1] - measured[0]) / 2e-5, abs=1e-3)
    assert max(map(abs, found)) > 0.01
    assert encounter(log, experiment).contact is not None or encounter(log, experiment).towards_speed is None


def test_the_command_says_same_or_what_differs(recorded, tmp_path: Path) -> None:
    from typer.testing import CliRunner

    from qpsafe.sim.recording.run_file import _digest

    result = CliRunner().invoke(app, ["replay", str(recorded[0]), "--json"])
    assert result.exit_code == 0, result.output
    assert json.loads(result.stdout)["same"] is True
    with np.load(recorded[0]) as archive:
        arrays = {name: archive[name] for name in archive.files if name != "header"}
        header = json.loads(str(archive["header"]))
    arrays["q_ref"][10, 2] += 1e-12
    header["digest"] = _digest(header, arrays)
    np.savez(tmp_path / "other.npz", header=np.array(json.dumps(header)), **arrays)
    result = CliRunner().invoke(app, ["replay", str(tmp_path / "other.npz")])
    assert result.exit_code == 1
    assert "the first is tick 10 at 0.040 s: q_ref[2] was" in " ".join(result.output.split())
