"""Digests of what decides a trial's rows: files, a robot; and whether files are still what was read of them.

What is made of files once a process is kept by their `State`, which costs no reading: a file that was edited between
two campaigns of a notebook is read again.
"""

from __future__ import annotations

import hashlib
import os
from functools import cache
from pathlib import Path
from xml.etree import ElementTree

from qpsafe.robot.loader import bundled_robots, find_robot, load_quietly
from qpsafe.robot.models.urdf_check import package_folders
from qpsafe.robot.robot import Robot
from qpsafe.sim.recording.digest import files_digest
from qpsafe.text.words import file_word

#: Of files: path, and what changes when they are written; None where there is none.
State = tuple[tuple[str, tuple[int, ...] | None], ...]
#: Letters of a name in a file's.
_LONGEST = 100


def robot_digest(name: str) -> str:
    """64 hexadecimal digits that stand for a robot: its own files, and its shapes, whatever files of meshes say them.

    Nothing else that lies in its folder counts, the trials themselves among it.
    """
    robot = load_quietly(name)
    found = hashlib.sha256(files_digest(sorted(_own_files(name, robot))).encode())
    for body, shape, vertices in robot.hulls():
        found.update(f"{body} {shape}".encode() + vertices.tobytes())
    return found.hexdigest()


def file_name_of(name: str) -> str:
    """A controller's name as a part of a file's: itself where a file may be called so, else its word and a digest.

    Two names that have one word, as ``a/b.py:f`` and ``a-b.py:f``, are two files.
    """
    word = file_word(name)
    if word == name and len(name) <= _LONGEST:
        return name
    return f"{word[-_LONGEST:]}-{hashlib.sha256(name.encode('utf-8', 'surrogatepass')).hexdigest()[:8]}".lstrip("-.")


def state_of(*paths: str | Path | None) -> State:
    """What changes when one of these is written anew; of a folder, when one of its TOML files is.

    Args:
        paths: Of files and folders, there or not; None for none.
    """
    return tuple((str(path), _stamp(path)) for given in paths if given is not None for path in _inside(given))


def robot_state(name: str) -> State:
    """The same for a robot: its own files and those that its model names; nothing for a bundled one.

    Args:
        name: As for `load_robot`.
    """
    if name in bundled_robots():
        return ()
    described = find_robot(name)
    model, files = _robot_files(name, state_of(described, *described.parent.glob("spots*.toml")))
    return state_of(*files, *_named_in(model, state_of(model)))


@cache
def _robot_files(name: str, described: State) -> tuple[Path, list[Path]]:
    """A robot's model and all its own files."""
    robot = load_quietly(name)
    return robot.model_path, sorted(_own_files(name, robot))


def _own_files(name: str, robot: Robot) -> set[Path]:
    spots = {*robot.folder.glob("spots*.toml"), *([] if robot.spots_path is None else [robot.spots_path])}
    return {find_robot(name), robot.model_path, *spots}


@cache
def _named_in(model: Path, state: State) -> list[Path]:
    """Files that an MJCF or URDF file names: meshes, and what it includes."""
    found: list[Path] = []
    try:
        root = ElementTree.parse(model).getroot()
    except (OSError, ElementTree.ParseError, ValueError):
        return found  # who loads it says what is wrong
    folders = [model.parent / item.get(key, "") for item in root.iter("compiler") for key in ("meshdir", "assetdir")]
    for name in (item.get("file") or item.get("filename") for item in root.iter()):
        if name is not None:
            _, apart, rest = name.rpartition("://")
            packages = map(Path, package_folders(model) if apart else [])
            places = (folder / rest for folder in (model.parent, *folders, *packages))
            found += [place for place in places if os.path.isfile(place)]
    return found


def _inside(path: str | Path) -> list[str | Path]:
    return [path, *sorted(Path(path).glob("*.toml"))] if os.path.isdir(path) else [path]


def _stamp(path: str | Path) -> tuple[int, ...] | None:
    try:
        found = os.stat(path)
    except (OSError, ValueError):
        return None
    if os.path.isdir(path):
        return ()  # its files say when they change
    return found.st_mtime_ns, found.st_ctime_ns, found.st_size, found.st_ino
