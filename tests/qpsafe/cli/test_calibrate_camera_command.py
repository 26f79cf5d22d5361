"""`qpsafe calibrate-camera`: writes what it found where it is good, and nothing where it is not."""

import json
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from qpsafe.cli.main import app
from qpsafe.errors import ConfigurationError
from qpsafe.ranging.cell_cameras import load_cameras, looking
from qpsafe.ranging.extrinsics import calibrate
from qpsafe.ranging.extrinsics.calibrate import CameraCalibration

run = CliRunner().invoke
CELL = """# mine
[[camera]]
name = "wall"
kind = "depth"
resolution = [8, 6]
field_of_view = [60.0, 45.0]
range_max = 5.0
rate = 30.0
"""
POSE = looking((2.0, 0.5, 1.5), (0.2, 0.0, 0.5))


@pytest.fixture
def files(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """A cell, a recording, and a calibration that says what `outcome` says; itself it is tested elsewhere."""
    (tmp_path / "cell.toml").write_text(CELL)
    np.savez(tmp_path / "r.npz", q=np.zeros((6, 6)), depth=np.ones((6, 6, 8)))

    def found(robot: object, recording: object, guess: object = None) -> CameraCalibration:
        weak = ("translation along (0.00, 0.00, 1.00)",) if guess is not None else ()
        return CameraCalibration(POSE, 1e-6 * np.eye(6), 0.012, 0.99, 0.01, 1234, 6, np.zeros(3), weak)

    monkeypatch.setattr(calibrate, "calibrate_camera", found)
    return ["calibrate-camera", str(tmp_path / "r.npz"), str(tmp_path / "cell.toml")]


def test_what_is_good_is_written(files: list[str], tmp_path: Path) -> None:
    out = tmp_path / "new.toml"
    done = run(app, [*files, "--json", "--out", str(out)])
    assert done.exit_code == 0, done.output
    report = json.loads(done.stdout)
    assert report["good"]
    assert report["position"] == pytest.approx(POSE[:3, 3])
    assert np.shape(report["covariance"]) == (6, 6)
    assert load_cameras(out)[0].pose == pytest.approx(POSE, abs=1e-5)
    assert (tmp_path / "cell.toml").read_text() == CELL
    assert run(app, [*files, "--write"]).exit_code == 0
    assert (tmp_path / "cell.toml").read_text() == out.read_text()
    assert out.read_text().startswith("# mine\n")


def test_what_is_bad_is_not_written(files: list[str], tmp_path: Path) -> None:
    out = tmp_path / "new.toml"
    done = run(app, [*files, "--tolerance", "0.01", "--out", str(out)])
    assert done.exit_code == 1
    assert "nothing is written" in done.output
    assert run(app, [*files, "--write"]).exit_code == 0
    before = (tmp_path / "cell.toml").read_text()
    done = run(app, [*files, "--guess", "--write"])
    assert done.exit_code == 1
    assert "translation along (0.00, 0.00, 1.00)" in done.output
    assert (tmp_path / "cell.toml").read_text() == before
    assert not out.exists()


def test_which_camera_is_asked(files: list[str], tmp_path: Path) -> None:
    for words, what in ((["--camera", "door"], "wall"), (["--guess"], "position")):
        done = run(app, [*files, *words])
        assert isinstance(done.exception, ConfigurationError)
        assert what in str(done.exception)
    (tmp_path / "cell.toml").write_text(CELL + CELL.replace("wall", "door"))
    assert "2 of them" in str(run(app, files).exception)
    assert run(app, [*files, "--camera", "door", "--out", str(tmp_path / "new.toml")]).exit_code == 0
    assert "position" in (tmp_path / "new.toml").read_text().split('"door"')[1]
