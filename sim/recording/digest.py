"""Digests of files and of the code that decides what a run computes."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from functools import cache
from pathlib import Path

import qpsafe
import qpsafe.robots
import qpsafe.sim
import qpsafe.tasks

#: Endings of what decides, and folders of what only shows.
_CODE, _OUTPUT = {".py", ".toml", ".xml", ".urdf"}, {"cli", "bench", "drawing", "report", "limit", "plugins", "irc5"}


@cache
def code_digest() -> str:
    """64 hexadecimal digits that stand for the code and the models that decide a run, or a trial's rows."""
    packages = (qpsafe, qpsafe.tasks, qpsafe.robots, qpsafe.sim)
    folders = [Path(path) for package in packages for path in package.__path__]
    files = [(path.relative_to(folder), path) for folder in folders for path in files_in(folder)]
    deciding = [path for name, path in sorted(files) if path.suffix in _CODE and not _OUTPUT & set(name.parts)]
    return files_digest(deciding)


def files_in(path: Path) -> list[Path]:
    """All files of a folder and below, in order; a file itself."""
    return sorted(item for item in path.rglob("*") if item.is_file()) if path.is_dir() else [path]


def files_digest(files: Sequence[Path]) -> str:
    """64 hexadecimal digits that stand for the contents of files, in their order."""
    found = hashlib.sha256()
    for file in files:
        found.update(hashlib.sha256(file.read_bytes()).digest())
    return found.hexdigest()
