"""Digests of files and of the code that decides what a run computes."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from functools import cache
from pathlib import Path
from types import ModuleType

import qpsafe
import qpsafe.robots
import qpsafe.sim
import qpsafe.tasks

#: Endings of what decides, and folders of what only shows.
_CODE, _OUTPUT = {".py", ".toml", ".xml", ".urdf"}, {"cli", "bench", "drawing", "report", "limit", "plugins", "irc5"}


@cache
def code_digest() -> str:
    """64 hexadecimal digits that stand for the code and the models that decide a run, or a trial's rows."""
    return files_digest(deciding((qpsafe, qpsafe.tasks, qpsafe.robots, qpsafe.sim)))


def deciding(packages: Sequence[ModuleType]) -> list[Path]:
    """Files that decide, each once and in the order of its name in Python: a clone and a wheel have the same ones.

    Args:
        packages: In a wheel some lie within others.
    """
    named = {
        Path(*package.__name__.split("."), file.relative_to(folder)): file
        for package in packages
        for folder in map(Path, package.__path__)
        for file in files_in(folder)
    }
    return [named[name] for name in sorted(named) if name.suffix in _CODE and not _OUTPUT & set(name.parts)]


def files_in(path: Path) -> list[Path]:
    """All files of a folder and below, in order; a file itself."""
    return sorted(item for item in path.rglob("*") if item.is_file()) if path.is_dir() else [path]


def files_digest(files: Sequence[Path]) -> str:
    """64 hexadecimal digits that stand for the contents of files, in their order."""
    found = hashlib.sha256()
    for file in files:
        found.update(hashlib.sha256(file.read_bytes()).digest())
    return found.hexdigest()
