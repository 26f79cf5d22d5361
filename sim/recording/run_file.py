"""A run as one file: what the controller was told and what it answered, bit by bit, and how to build it anew.

The file is a NumPy archive (.npz). ``header`` is JSON: the format's version, the experiment's settings, the versions of
the packages that compute, a fingerprint of the robot's files, messages and spot names. The arrays are those of the run
log that replay needs, and pictures of the simulation's state (joints, screws, people) at 25 a second.
"""

from __future__ import annotations

import hashlib
import json
import os
import sys
import zipfile
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from qpsafe.errors import QpsafeError
from qpsafe.sim.recording.digest import code_digest
from qpsafe.sim.recording.log import RunLog
from qpsafe.sim.world.plant import Plant
from qpsafe.sim.world.scene import Scene
from qpsafe.text.json_text import json_text
from qpsafe.tick import Tick

if TYPE_CHECKING:
    from qpsafe.robot.robot import Robot

FORMAT, VERSION = "qpsafe run", 1
SUFFIX = ".npz"
#: What the controller was told, and what it answered.
INPUTS = ("q", "qd", "distances")
OUTPUTS = ("q_ref", "qd_ref", "cdf_n", "m", "f", "regime", "phase", "status")
#: Packages whose arithmetic decides the last bits.
PACKAGES = ("qpsafe", "numpy", "scipy", "numba", "pin", "mujoco", "daqp", "ruckig")
#: Between two versions the code changes, too.
CODE = "code of qpsafe"
FPS = 25
#: Begins fingerprints of a robot; older ones, of all that lay in its folder and of nothing else, cannot be compared.
PRINT = "sha256:"
#: No run of ten minutes, the longest that a demo makes, expands to a third of this [bytes].
LARGEST = 2**29


class RunFileError(QpsafeError, ValueError):
    """A file of a run cannot be used: it says which file, and why."""


class StateRecorder:
    """Keeps the simulation's state at 25 pictures a second: pass `observe` as an observer of the run."""

    def __init__(self, dt: float = 0.004) -> None:
        self._every = max(round(1.0 / (FPS * dt)), 1)
        self._qpos: list[NDArray[np.float64]] = []
        self._mocap: list[NDArray[np.float64]] = []

    def observe(self, tick: Tick, scene: Scene, plant: Plant) -> None:
        """Keep the state if one is due.

        Args:
            tick: The tick.
            scene: What is simulated.
            plant: The state of it.
        """
        if tick.reference.seq % self._every == 0:
            self._qpos.append(plant.data.qpos.copy())
            self._mocap.append(np.hstack((plant.data.mocap_pos, plant.data.mocap_quat)))

    def arrays(self) -> dict[str, NDArray]:
        """``state_qpos`` (N, nq) and ``state_mocap`` (N, bodies, 7); empty without observation."""
        return {"state_qpos": np.array(self._qpos), "state_mocap": np.array(self._mocap)}


@dataclass(frozen=True)
class RunFile:
    """A run as read from a file.

    Attributes:
        path: The file.
        header: Its header.
        arrays: `INPUTS` and `OUTPUTS`, N ticks each, and the states.
    """

    path: Path
    header: dict[str, Any]
    arrays: dict[str, NDArray]

    @property
    def ticks(self) -> int:
        """Number of ticks."""
        return len(self.arrays["q"])

    def messages(self) -> dict[int, tuple[str, ...]]:
        """Messages of each tick that had any."""
        found: dict[int, tuple[str, ...]] = {}
        for tick, text in self.header["messages"]:
            found[tick] = (*found.get(tick, ()), text)
        return found


def versions() -> dict[str, str]:
    """Versions of Python and of the packages whose arithmetic decides the last bits, and of the code itself."""
    found = {"python": ".".join(map(str, sys.version_info[:3]))}
    for name in PACKAGES:
        try:
            found[name] = version(name)
        except PackageNotFoundError:
            found[name] = "not installed"
    return found | {CODE: code_digest()[:12]}


def fingerprint(robot: Robot) -> str:
    """SHA-256 of what decides what the controller does: the robot's own files, wherever they lie, and its shapes.

    Nothing else that lies in its folder counts; shapes do, whatever files of meshes say them.
    """
    digest = hashlib.sha256()
    files = {robot.folder / "robot.toml", robot.model_path, *robot.folder.glob("spots*.toml"), robot.spots_path}
    for path in sorted((path for path in files if path is not None and path.is_file()), key=lambda path: path.name):
        digest.update(path.name.encode() + b"\0" + hashlib.sha256(path.read_bytes()).digest())
    for body, shape, vertices in robot.hulls():
        digest.update(f"{body} {shape}".encode() + vertices.tobytes())
    return PRINT + digest.hexdigest()


def write_run(
    path: Path, log: RunLog, settings: dict[str, Any], robot: Robot, states: StateRecorder | None = None
) -> None:
    """Write a run, whole or not at all.

    Args:
        path: Ends in .npz.
        log: The run.
        settings: From `qpsafe.sim.replay.settings.settings_of`.
        robot: Of the run.
        states: What was drawn, for replays that are looked at.
    """
    header = {
        "format": FORMAT,
        "version": VERSION,
        "settings": settings,
        "versions": versions(),
        "robot_files": fingerprint(robot),
        "dt": log.dt,
        "spots": list(log.spot_names),
        "messages": [[tick, text] for tick, text in log.messages],
    }
    arrays = {name: getattr(log, name) for name in (*INPUTS, *OUTPUTS)}
    arrays |= StateRecorder().arrays() if states is None else states.arrays()
    header["digest"] = _digest(header, arrays)
    part = path.with_name(f".{path.stem}.{os.getpid()}.part{SUFFIX}")
    try:
        np.savez_compressed(part, header=np.array(json_text(header, indent=None)), **arrays)
        part.replace(path)
    finally:
        part.unlink(missing_ok=True)


def read_run(path: str | Path) -> RunFile:
    """Read a run.

    Raises:
        RunFileError: The file is missing, damaged, cut short, of another kind, of a newer version, or would expand to
            more than `LARGEST`.
    """
    path = Path(path)
    try:
        with zipfile.ZipFile(path) as members:  # which reads no more of a member than it states
            expanded = sum(member.file_size for member in members.infolist())
        if expanded > LARGEST:
            size = f"{expanded / 2**20:,.0f} MiB"
            raise RunFileError(f"{path}: it would expand to {size}; a run has at most {LARGEST // 2**20} MiB")
        with np.load(path, allow_pickle=False) as archive:
            if "header" not in archive:
                raise RunFileError(f"{path}: not a run of qpsafe: it has no header")
            header = json.loads(str(archive["header"]))
            arrays = {name: archive[name] for name in archive.files if name != "header"}
    except RunFileError:
        raise
    except FileNotFoundError:
        raise RunFileError(f"{path}: no such file") from None
    except (OSError, ValueError, KeyError, EOFError, zipfile.BadZipFile, zipfile.zlib.error) as problem:  # type: ignore[attr-defined]
        raise RunFileError(f"{path}: damaged, or not a run of qpsafe: {problem}") from None
    except (NotImplementedError, RuntimeError, AttributeError, TypeError, MemoryError) as problem:
        raise RunFileError(f"{path}: not a run of qpsafe: {problem}") from None
    _check(path, header, arrays)
    return RunFile(path, header, arrays)


def _digest(header: dict[str, Any], arrays: dict[str, NDArray]) -> str:
    """SHA-256 of everything but itself: no bit can change unseen."""
    digest = hashlib.sha256(json_text({**header, "digest": ""}, indent=None, sort_keys=True).encode())
    for name in sorted(arrays):
        digest.update(f"{name} {arrays[name].dtype.str} {arrays[name].shape}".encode())
        digest.update(np.ascontiguousarray(arrays[name]).tobytes())
    return digest.hexdigest()


def _check(path: Path, header: Any, arrays: dict[str, NDArray]) -> None:
    if not isinstance(header, dict) or header.get("format") != FORMAT:
        raise RunFileError(f"{path}: not a run of qpsafe: its header says {str(header)[:60]!r}")
    if header.get("version") != VERSION:
        raise RunFileError(f"{path}: version {header.get('version')!r} of the format; this qpsafe reads {VERSION}")
    for key in ("settings", "versions", "messages", "spots", "dt", "robot_files"):
        if key not in header:
            raise RunFileError(f"{path}: its header lacks {key!r}")
    kinds = {"settings": dict, "versions": dict, "messages": list, "spots": list, "dt": float, "robot_files": str}
    for key, kind in kinds.items():
        if not isinstance(header[key], kind):
            raise RunFileError(f"{path}: {key!r} in its header is no {kind.__name__}")
    if not all(isinstance(m, list) and [type(part) for part in m] == [int, str] for m in header["messages"]):
        raise RunFileError(f"{path}: 'messages' in its header are no pairs of tick and text")
    if header.get("digest") != _digest(header, arrays):
        raise RunFileError(f"{path}: not as it was written: its digest is another one")
    for name in (*INPUTS, *OUTPUTS):
        if name not in arrays:
            raise RunFileError(f"{path}: it lacks the array {name!r}")
    lengths = {name: len(np.atleast_1d(arrays[name])) for name in (*INPUTS, *OUTPUTS)}
    if len(set(lengths.values())) != 1:
        raise RunFileError(f"{path}: arrays of different lengths: {lengths}")
    for name in (*INPUTS, "q_ref", "qd_ref", "cdf_n", "m", "f"):
        wanted = 2 if name in ("q", "qd", "distances", "q_ref", "qd_ref") else 1
        if arrays[name].dtype != np.float64 or arrays[name].ndim != wanted:
            raise RunFileError(f"{path}: array {name!r} is {arrays[name].dtype}, {arrays[name].ndim}-dimensional")
