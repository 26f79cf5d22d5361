"""Logs of joint references: one CSV for people, one compact binary for machines, both read back equal.

A log is written record by record into `<name>.part`, which becomes `<name>` when it is closed: under its own name it is
whole or not there. After a crash, all records that reached the disk are read from the `.part` file. Where nothing was
recorded there is no log, and an older one of that name stays.
"""

from __future__ import annotations

import os
from collections.abc import Iterable
from contextlib import suppress
from pathlib import Path
from types import TracebackType
from typing import NamedTuple, Self

from qpsafe.errors import ConfigurationError, QpsafeError
from qpsafe.irc5.process.outlet import Outlet
from qpsafe.irc5.records.formats import BinaryFormat, CsvFormat, ReferenceFormat
from qpsafe.reference import JointReference
from qpsafe.text.given import flag, of_kind, whole

#: Records between two flushes to the operating system: a second of references.
FLUSH_EVERY = 250


class ReferenceLogError(QpsafeError, ValueError):
    """A file is no log of joint references, or is damaged; the message says where."""


#: Ending of the name -> format.
FORMATS: dict[str, ReferenceFormat] = {".csv": CsvFormat(), ".qpref": BinaryFormat()}


def _path(value: str | Path) -> Path:
    if not isinstance(value, str | os.PathLike):
        raise ConfigurationError("reference log", "path", value, "the name of a file")
    return Path(value)


def _format(path: Path) -> ReferenceFormat:
    name = path.with_suffix("") if path.suffix == ".part" else path
    found = FORMATS.get(name.suffix)
    if found is None:
        raise ConfigurationError("reference log", "path", str(path), "a name that ends in " + " or ".join(FORMATS))
    return found


class ReferenceWriter:
    """Writes references as they come; use it in a `with` statement.

    Args:
        path: Name of the log, ending in ``.csv`` or ``.qpref`` (binary). Its folder must exist.
        n: Number of joints.
        beside: Let a thread of its own write, so that the caller never waits for the disk. Nothing raises OSError then
            but the making of the file: a full disk is told by `trouble`, and leaves the ``.part`` file.

    Attributes:
        count: References taken so far.

    Raises:
        ConfigurationError: The name or its ending is another one, n is no number of joints, or `beside` neither True
            nor False.
        OSError: The file cannot be made.
    """

    def __init__(self, path: str | Path, n: int, beside: bool = False) -> None:
        self.path = _path(path)
        self.part = self.path.with_name(self.path.name + ".part")
        self.count = 0
        self._format = _format(self.path)
        self.n = whole("reference log", "n", n, "a number of joints, 1 to 255", 1, 255)
        flag("reference log", "beside", beside)
        self._file = self.part.open("wb", buffering=0)
        self._outlet = Outlet(self._file.write, "log", due=5.0) if beside else None
        self._kept = bytearray(self._format.header(self.n))
        self._hand_over()

    def write(self, reference: JointReference) -> None:
        """Append one reference, as a whole.

        Raises:
            ValueError: It is not one of n joints.
        """
        self._kept += self._format.record(reference, self.n)
        self.count += 1
        if self.count % FLUSH_EVERY == 0:
            self._hand_over()

    def trouble(self, now: float) -> str:
        """Why references do not reach the disk, empty if they do; `now` is a monotonic clock [s]."""
        return "" if self._outlet is None else self._outlet.trouble(now)

    def close(self) -> None:
        """Finish the log and give it its name, if all of it is there; nothing if that was done.

        Of a log without a reference nothing is left.
        """
        if not self._file.closed and self._end():
            try:
                if self.count:
                    os.replace(self.part, self.path)
                else:
                    self.part.unlink(missing_ok=True)
            except OSError as error:
                if self._outlet is None:
                    raise
                self._outlet.failure = str(error)

    def _end(self) -> bool:
        """Write what is left and close the file; whether all of it was written."""
        try:
            self._hand_over()
            return self._outlet is None or self._outlet.close()
        finally:
            if self._outlet is None or not self._outlet.busy:  # closing a file that a disk holds up would wait for it
                self._file.close()

    def _hand_over(self) -> None:
        kept, self._kept = bytes(self._kept), bytearray()
        if self._outlet is not None:
            self._outlet.write(kept)
            return
        left = memoryview(kept)
        while left:
            left = left[self._file.write(left) :]

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if kind is None:
            self.close()
        elif not self._file.closed:  # what is there stays readable, under the name of a log that was not finished
            with suppress(OSError):
                (self._end if self.count else self.close)()


def write_references(path: str | Path, references: Iterable[JointReference]) -> None:
    """Write a log, whole or not at all: after an error nothing is left, and an older file of that name stays.

    Raises:
        ConfigurationError: The name is none or has another ending, something is no reference, or there is none to tell
            the number of joints.
        ValueError: A reference has another number of joints than the first one.
    """
    _format(_path(path))
    of_kind("reference log", "references", references, Iterable)
    references = list(references)
    if not references:
        raise ConfigurationError("reference log", "references", references, "at least one")
    for reference in references:
        of_kind("reference log", "references", reference, JointReference)
    writer = ReferenceWriter(path, len(references[0].q))
    try:
        with writer:
            for reference in references:
                writer.write(reference)
    finally:
        writer.part.unlink(missing_ok=True)


class ReferenceLog(NamedTuple):
    """What a log holds.

    Attributes:
        references: All whole records, in order.
        torn: Bytes of a last record that is not whole, after a crash; 0 otherwise.
    """

    references: list[JointReference]
    torn: int


def read_references(path: str | Path) -> ReferenceLog:
    """Read a log, or the `.part` file of one that was not finished.

    Raises:
        ReferenceLogError: It is none, or is damaged elsewhere than at its very end.
        ConfigurationError: The name is none, or has another ending.
    """
    path = _path(path)
    kind, data = _format(path), path.read_bytes()
    try:
        references, used = kind.read(data)
    except ValueError as error:
        raise ReferenceLogError(f"{path}: {error}") from None
    return ReferenceLog(references, len(data) - used)
