"""Finished trials on disk: Parquet files beside a manifest that says whose they are.

One reader checks every file against the manifest, whoever asks: rows of another campaign, or rows that do not pair, are
refused by name. Every file is written under another name first and then renamed, so a file is whole or not there,
whatever ends the process. Its name stands for the trials in it: no file is ever overwritten by another one.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from qpsafe.errors import ConfigurationError
from qpsafe.extras import require
from qpsafe.sim.campaign.manifest import MANIFEST, Manifest, lasting_file, read_manifest, versions_now
from qpsafe.sim.campaign.plan import Plan
from qpsafe.sim.campaign.trials.rows import COLUMNS, DTYPES, NAMES, Columns, joined
from qpsafe.text.json_text import plain

if TYPE_CHECKING:
    from numpy.typing import NDArray


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
        self._identity, self._new = plain(plan.identity()), not (folder / MANIFEST).exists()
        there = Manifest(plan, self._identity, {}) if self._new else read_manifest(folder)
        if (key := _other(there.identity, self._identity)) is not None:
            expected = f"{self._identity.get(key)!r}, as now: trials of both do not mix; take another folder"
            raise ConfigurationError(folder, key, there.identity.get(key), expected)
        self._manifest = there._replace(plan=plan, identity=self._identity)
        self._manifest.write(folder)

    def close(self) -> None:
        """Take the manifest away again if it is new and no trial was finished."""
        if self._new and not _files(self.folder):
            (self.folder / MANIFEST).unlink(missing_ok=True)

    def trials(self) -> set[int]:
        """Numbers of the trials that are kept."""
        return set(self.read().columns["trial"].tolist())

    def keep(self, parts: Iterable[Played]) -> None:
        """Write finished trials into a file of their own.

        Raises:
            OSError: The disk is full, or the folder has gone.
            ConfigurationError: A file of the plan was edited while they were played: nobody knows whose they are.
        """
        parts = list(parts)
        if not parts:
            return
        now = plain(self.plan.identity())
        if (key := _other(self._identity, now)) is not None:
            expected = f"{self._identity.get(key)!r}, as when it began: trials that were played since are not kept"
            raise ConfigurationError(self.folder, key, now.get(key), expected)
        columns = joined([part.columns for part in parts], self.plan.controllers)
        meta = {"seconds": repr(sum(part.seconds for part in parts)), "plan": self._manifest.digest}
        fields = [
            self._arrow.field(c.name, _type(c.kind), metadata={"unit": c.unit, "meaning": c.meaning}) for c in COLUMNS
        ]
        table = self._arrow.table([columns[name] for name in NAMES], self._arrow.schema(fields, meta))
        name = hashlib.sha256(np.unique(columns["trial"]).tobytes()).hexdigest()[:16]
        self._manifest = self._manifest.with_versions(versions_now())
        self._manifest.write(self.folder)
        with lasting_file(self.folder / f"trials-{name}.parquet") as part:
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
        ConfigurationError: A file cannot be read, has other columns, or rows that are not the campaign's.
    """
    manifest = read_manifest(folder)
    parts, seconds = [], 0.0
    for file in _files(folder):
        here, cost = _rows(file, manifest)
        wanted: NDArray[np.bool_] = here["trial"] < plan.trials
        seconds += cost * float(wanted.mean()) if len(wanted) else 0.0
        parts.append({name: values[wanted] for name, values in here.items()})
    return Played(joined(parts, plan.controllers), seconds)


def stored_plan(folder: Path) -> Plan:
    """The plan of a folder's trials, as it was: what it names may have gone since.

    Raises:
        ConfigurationError: The folder has no manifest, or an invalid one.
    """
    return read_manifest(folder).plan


def stored_versions(folder: Path) -> dict[str, str]:
    """Versions of what the trials were played with."""
    return read_manifest(folder).versions


def _files(folder: Path) -> list[Path]:
    return sorted(folder.glob("trials-*.parquet"))


def _rows(file: Path, manifest: Manifest) -> tuple[Columns, float]:
    """Rows of a file and the seconds they took; all of them are the manifest's."""
    _, parquet = _pyarrow()
    with _reading(file):
        table = parquet.ParquetFile(file).read()
        meta = table.schema.metadata
        seconds, whose = float(meta[b"seconds"]), meta.get(b"plan", manifest.digest.encode()).decode()
        for c in COLUMNS:
            if table.schema.field(c.name).type != _type(c.kind) or table[c.name].null_count:
                raise ValueError(f"{c.name} has other values than {c.kind.__name__}, or none")
        arrays = {name: table[name].to_numpy() for name in NAMES}
    here: Columns = {c.name: np.asarray(arrays[c.name], dtype=DTYPES[c.kind]) for c in COLUMNS}
    expected = "trials of one campaign in a folder; take the file away, and they are played again"
    if whose != manifest.digest:
        raise ConfigurationError(file, "plan", whose, f"{manifest.digest}, the manifest's: {expected}")
    plan, trial = manifest.plan, here["trial"]
    numbers = np.unique(trial)
    for key, wanted in (
        ("trial", np.repeat(numbers, len(plan.controllers))),
        ("controller", np.tile(plan.controllers, len(numbers))),
        ("seed", plan.seed + trial),
    ):
        if (trial < 0).any() or not np.array_equal(here[key], wanted):
            problem = f"{len(trial)} rows of {len(numbers)} trials"
            needed = f"of each trial one row of {', '.join(plan.controllers)}, its seed {plan.seed} + trial: {expected}"
            raise ConfigurationError(file, key, problem, needed)
    return here, seconds


def _other(one: dict[str, Any], other: dict[str, Any]) -> str | None:
    """The first key in which two identities differ; None if they do not."""
    return next((key for key in {**other, **one} if one.get(key) != other.get(key)), None)


def _type(kind: type) -> Any:
    return _pyarrow()[0].from_numpy_dtype(DTYPES[kind])


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
