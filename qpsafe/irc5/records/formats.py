"""How a joint reference becomes bytes and is read back: as a line of CSV, and as a binary record with a checksum."""

from __future__ import annotations

import struct
import zlib
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from qpsafe.reference import JointReference, ServoGains
from qpsafe.text.words import counted

Array = NDArray[np.float64]


class ReferenceFormat(Protocol):
    """A file is a header and records, one a reference, of n joints each."""

    def header(self, n: int) -> bytes:
        """The start of the file."""

    def record(self, reference: JointReference, n: int) -> bytes:
        """One reference. Raises ValueError if it is not one of n joints."""

    def read(self, data: bytes) -> tuple[list[JointReference], int]:
        """All whole records of a file, and the bytes up to their end; behind it a torn record may follow.

        Raises:
            ValueError: With the place and what is wrong there.
        """


def _blocks(reference: JointReference, n: int) -> tuple[Array | None, ...]:
    """posRef, velRef, trqFfw, Kp, Kv, Ki, each (n,) or None."""
    gains = (None, None, None) if reference.gains is None else reference.gains
    blocks = (reference.q, reference.qd, reference.torque, *gains)
    if any(np.shape(block) != (n,) for block in blocks if block is not None) or reference.q is None:
        raise ValueError(f"reference {reference.seq} is not one of {counted(n, 'joint')}")
    return blocks


def _reference(seq: int, time: float, active: bool, blocks: list[Array | None]) -> JointReference:
    q, qd, torque, kp, kv, ki = blocks
    if q is None or qd is None:
        raise ValueError("posRef or velRef is missing")
    gains = None if kp is None or kv is None or ki is None else ServoGains(kp, kv, ki)
    if gains is None and not (kp is None and kv is None and ki is None):
        raise ValueError("some of the gains are missing")
    return JointReference(seq, time, q, qd, active, torque, gains)


class BinaryFormat:
    """117 bytes a tick for six joints, all little-endian.

    Header: ``QPSREF1`` and a line feed, the number of joints n (one byte), seven zero bytes. Record: flags (one byte: 1
    active, 2 with torque, 4 with gains), seq (int64), time (float64), then n float64 each of posRef, velRef, trqFfw if
    there, Kp, Kv, Ki if there, and the CRC-32 of all of that (uint32).
    """

    MAGIC = b"QPSREF1\n"
    ACTIVE, TORQUE, GAINS = 1, 2, 4
    _header = struct.Struct("<8sB7x")
    _start = struct.Struct("<Bqd")
    _sum = struct.Struct("<I")

    def header(self, n: int) -> bytes:
        """The start of the file."""
        return self._header.pack(self.MAGIC, n)

    def record(self, reference: JointReference, n: int) -> bytes:
        """One reference."""
        blocks = _blocks(reference, n)
        flags = self.ACTIVE if reference.active else 0
        flags += self.TORQUE if reference.torque is not None else 0
        flags += self.GAINS if reference.gains is not None else 0
        data = self._start.pack(flags, reference.seq, reference.time)
        data += b"".join(np.asarray(block, dtype="<f8").tobytes() for block in blocks if block is not None)
        return data + self._sum.pack(zlib.crc32(data))

    def read(self, data: bytes) -> tuple[list[JointReference], int]:
        """All whole records, and the bytes up to their end."""
        if not data.startswith(self.MAGIC) or len(data) < self._header.size:
            raise ValueError("no binary log of joint references: it does not start as one")
        _, n = self._header.unpack_from(data)
        found: list[JointReference] = []
        place = self._header.size
        while place + self._start.size <= len(data):
            flags, seq, time = self._start.unpack_from(data, place)
            there = (True, True, flags & self.TORQUE, *3 * (flags & self.GAINS,))
            start = place + self._start.size
            end = start + 8 * n * sum(map(bool, there))
            if end + self._sum.size > len(data):
                break
            if zlib.crc32(data[place:end]) != self._sum.unpack_from(data, end)[0]:
                raise ValueError(f"record {len(found)}, at byte {place}, is damaged")
            rows = iter(np.frombuffer(data[start:end], dtype="<f8").astype(np.float64).reshape(-1, n))
            blocks = [next(rows).copy() if block else None for block in there]
            found.append(_reference(seq, time, bool(flags & self.ACTIVE), blocks))
            place = end + self._sum.size
        return found, place


class CsvFormat:
    """One line a tick, numbers in the shortest form that reads back equal; cells of what is not there are empty."""

    COLUMNS = ("posRef [rad]", "velRef [rad/s]", "trqFfw [N m]", "Kp [1/s]", "Kv [N m s/rad]", "Ki [N m/rad]")

    def header(self, n: int) -> bytes:
        """The line with the names and units of the columns."""
        names = ["seq", "time [s]", "active"]
        for column in self.COLUMNS:
            name, unit = column.split(" ", 1)
            names += [f"{name}_{joint} {unit}" for joint in range(1, n + 1)]
        return (",".join(names) + "\n").encode()

    def record(self, reference: JointReference, n: int) -> bytes:
        """One line."""
        cells = [str(int(reference.seq)), repr(float(reference.time)), "1" if reference.active else "0"]
        for block in _blocks(reference, n):
            cells += [""] * n if block is None else map(repr, np.asarray(block, dtype=float).tolist())
        return (",".join(cells) + "\n").encode()

    def read(self, data: bytes) -> tuple[list[JointReference], int]:
        """All whole lines, and the bytes up to their end."""
        used = data.rfind(b"\n") + 1
        header, *lines = data[:used].decode("utf-8", errors="replace").splitlines() or [""]
        n = header.count("posRef_")
        if n == 0 or header != self.header(n).decode().strip():
            raise ValueError("no CSV log of joint references: line 1 does not have its columns")
        found = []
        for number, line in enumerate(lines, start=2):
            try:
                found.append(self._parse(line.split(","), n))
            except ValueError as error:
                raise ValueError(f"line {number}: {error}") from None
        return found, used

    def _parse(self, cells: list[str], n: int) -> JointReference:
        if len(cells) != 3 + n * len(self.COLUMNS):
            raise ValueError(f"{len(cells)} cells, expected {3 + n * len(self.COLUMNS)}")
        if cells[2] not in ("0", "1"):
            raise ValueError(f"active = {cells[2]!r}, expected 0 or 1")
        blocks: list[Array | None] = []
        for k in range(len(self.COLUMNS)):
            group = cells[3 + k * n : 3 + (k + 1) * n]
            blocks.append(np.array(list(map(float, group))) if any(group) else None)
        return _reference(int(cells[0]), float(cells[1]), cells[2] == "1", blocks)
