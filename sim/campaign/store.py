"""Finished trials on disk: Parquet files beside a manifest that says whose they are.

Every file is written under another name first and then renamed, so a file is whole or not there, whatever ends the
process. Its name stands for the trials in it: no file is ever overwritten by another one.
"""

from __future__ import annotations

import hashlib
import json
import os
import platform
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from importlib import metadata
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from qpsafe.errors import ConfigurationError
from qpsafe.extras import require
from qpsafe.sim.campaign.plan import Plan
from qpsafe.sim.campaign.trials.rows import COLUMNS, DTYPES, NAMES, Columns, joined
from qpsafe.text.json_text import json_text

if TYPE_CHECKING:
    from numpy.typing import NDArray

FORMAT = "qpsafe campaign 1"
MANIFEST = "manifest.json"
PACKAGES = ("qpsafe", "numpy", "scipy", "numba", "mujoco", "pin")


class Played(NamedTuple):
    """Whole trials, and what they cost.

    Attributes:
        columns: Rows of all their controllers.
        seconds: Time that the processes which played them took, all together.
    """

    columns: Columns
    seconds: float


class Store:
    """A folder with finished trials of one plan.

    Args:
        folder: That has, or gets, a manifest; made if it is not there.
        plan: Whose trials.

    Raises:
        MissingExtraError: pyarrow is not installed.
        ConfigurationError: The folder holds trials of another plan or of other code, or cannot be read.
    """

    def __init__(self, folder: Path, plan: Plan) -> None:
        self._arrow, self._parquet = _pyarrow()
        self.folder, self.plan = folder, plan
        folder.mkdir(parents=True, exist_ok=True)
        for left in folder.glob(".*.part"):  # of a process that was killed
            left.unlink(missing_ok=True)
        identity = plan.identity()
        if (folder / MANIFEST).exists():
            there = _manifest(folder)["identity"]
            for key in (key for key in identity if there.get(key) != json.loads(json_text(identity[key]))):
                raise ConfigurationError(
                    folder,
                    key,
                    there.get(key),
                    f"{identity[key]!r}, as now: trials of both do not mix; take another folder",
                )
        _write(
            folder / MANIFEST,
            json_text({"format": FORMAT, "plan": plan.to_dict(), "identity": identity, "versions": versions()}) + "\n",
        )

    def trials(self) -> set[int]:
        """Numbers of the trials that are kept."""
        found: set[int] = set()
        for file in _files(self.folder):
            with _reading(file):
                found.update(self._parquet.ParquetFile(file).read(["trial"])["trial"].to_pylist())
        return found

    def keep(self, parts: Iterable[Played]) -> None:
        """Write finished trials into a file of their own.

        Raises:
            OSError: The disk is full, or the folder has gone.
        """
        parts = list(parts)
        if not parts:
            return
        columns = joined([part.columns for part in parts], self.plan.controllers)
        meta = {"seconds": repr(sum(part.seconds for part in parts))}
        fields = [
            self._arrow.field(
                c.name,
                self._arrow.from_numpy_dtype(DTYPES[c.kind]),
                metadata={"unit": c.unit, "meaning": c.meaning},
            )
            for c in COLUMNS
        ]
        table = self._arrow.table([columns[name] for name in NAMES], self._arrow.schema(fields, meta))
        name = hashlib.sha256(np.unique(columns["trial"]).tobytes()).hexdigest()[:16]
        with _replacing(self.folder / f"trials-{name}.parquet") as part:
            self._parquet.write_table(table, part, compression="zstd")

    def read(self) -> Played:
        """All trials of the plan that are kept."""
        return read(self.folder, self.plan)


def read(folder: Path, plan: Plan) -> Played:
    """The trials of a plan that a folder holds, in order.

    Args:
        folder: Of a campaign.
        plan: Which trials, and the order of the controllers.

    Raises:
        MissingExtraError: pyarrow is not installed.
        ConfigurationError: A file cannot be read, or has other columns.
    """
    _, parquet = _pyarrow()
    parts, seconds = [], 0.0
    for file in _files(folder):
        with _reading(file):
            table = parquet.ParquetFile(file).read()
            cost = float(table.schema.metadata[b"seconds"])
            arrays = {name: table[name].to_numpy() for name in NAMES}
        here: Columns = {c.name: np.asarray(arrays[c.name], dtype=DTYPES[c.kind]) for c in COLUMNS}
        wanted: NDArray[np.bool_] = here["trial"] < plan.trials
        seconds += cost * float(wanted.mean())
        parts.append({name: values[wanted] for name, values in here.items()})
    return Played(joined(parts, plan.controllers), seconds)


def stored_plan(folder: Path) -> Plan:
    """The plan of a folder's trials, as it was: not checked against what is here now.

    Raises:
        ConfigurationError: The folder has no manifest, or an invalid one.
    """
    said = _manifest(folder)["plan"]
    plan = object.__new__(Plan)  # people's file, say, may have gone since
    for key, value in said.items():
        object.__setattr__(plan, key, tuple(value) if isinstance(value, list) else value)
    return plan


def stored_versions(folder: Path) -> dict[str, str]:
    """Versions of what the trials were played with."""
    return dict(_manifest(folder)["versions"])


def versions() -> dict[str, str]:
    """Versions of Python and the packages that decide numbers."""
    return {"python": platform.python_version()} | {name: metadata.version(name) for name in PACKAGES}


def _manifest(folder: Path) -> dict[str, Any]:
    file = folder / MANIFEST
    try:
        said = json.loads(file.read_text(encoding="utf-8"))
        assert said["format"] == FORMAT
        assert said["plan"].keys() == Plan().to_dict().keys()
        return {"identity": dict(said["identity"]), "plan": said["plan"], "versions": said["versions"]}
    except (OSError, ValueError, KeyError, AttributeError, TypeError, AssertionError) as error:
        problem = f"{type(error).__name__} {error}".strip()
        raise ConfigurationError(
            folder, MANIFEST, problem, f"a folder of a campaign, with a manifest: {FORMAT!r}"
        ) from None


def _files(folder: Path) -> list[Path]:
    return sorted(folder.glob("trials-*.parquet"))


@contextmanager
def _reading(file: Path) -> Iterator[None]:
    """Name the file that cannot be read."""
    arrow, _ = _pyarrow()
    try:
        yield
    except (arrow.ArrowException, OSError, KeyError, TypeError, ValueError) as error:
        expected = "trials of a campaign; if you remove the file they are played again"
        raise ConfigurationError(file, "file", f"{error}", expected) from None


def _pyarrow() -> tuple[Any, Any]:
    require("campaign", "a folder of trials", "pyarrow")
    import pyarrow
    import pyarrow.parquet

    return pyarrow, pyarrow.parquet


def _write(path: Path, text: str) -> None:
    with _replacing(path) as part:
        part.write_text(text, encoding="utf-8")


@contextmanager
def _replacing(path: Path) -> Iterator[Path]:
    """A path to write to, which takes the place of another one when it is on the disk."""
    part = path.with_name(f".{path.name}.{os.getpid()}.part")
    try:
        yield part
        with part.open("rb") as file:
            os.fsync(file.fileno())
        part.replace(path)
    finally:
        part.unlink(missing_ok=True)
