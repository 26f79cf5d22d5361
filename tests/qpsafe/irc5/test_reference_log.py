"""Logs of joint references: read back equal, whole or not there, readable after a crash at any byte."""

from __future__ import annotations

import errno
import struct
import time
from contextlib import suppress
from pathlib import Path

import amounts
import numpy as np
import pytest
from amounts import first
from hypothesis import given, settings
from hypothesis import strategies as st

import qpsafe
from qpsafe.errors import ConfigurationError
from qpsafe.irc5.records.log import FORMATS, ReferenceLogError, ReferenceWriter, read_references, write_references
from qpsafe.reference import JointReference, ServoGains

ENDINGS = sorted(FORMATS)
NUMBERS = st.floats(allow_nan=True, allow_infinity=True)


def joints(n: int) -> st.SearchStrategy[np.ndarray]:
    return st.lists(NUMBERS, min_size=n, max_size=n).map(lambda values: np.array(values))


def references(n: int) -> st.SearchStrategy[JointReference]:
    gains = st.builds(ServoGains, joints(n), joints(n), joints(n))
    return st.builds(
        JointReference,
        st.integers(0, 2**63 - 1),
        NUMBERS,
        joints(n),
        joints(n),
        st.booleans(),
        st.none() | joints(n),
        st.none() | gains,
    )


LOGS = st.integers(1, 9).flatmap(lambda n: st.lists(references(n), min_size=1, max_size=6))


def some(count: int = 5, n: int = 6) -> list[JointReference]:
    random = np.random.default_rng(3)
    gains = ServoGains(*random.normal(size=(3, n)))
    found = [JointReference(k, 0.004 * k, *random.normal(size=(2, n)), k > 0) for k in range(count - 2)]
    found.append(JointReference(count - 2, 0.1, *random.normal(size=(2, n)), True, random.normal(size=n)))
    found.append(JointReference(count - 1, 0.1, *random.normal(size=(2, n)), True, random.normal(size=n), gains))
    return found


@pytest.mark.parametrize("ending", ENDINGS)
@settings(max_examples=amounts.some(20, of=60))
@given(log=LOGS)
def test_what_is_written_is_read_back_equal(log: list[JointReference], ending: str, tmp_path_factory) -> None:
    path = tmp_path_factory.mktemp("log") / f"log{ending}"
    write_references(path, log)
    found = read_references(path)
    assert found.references == log
    assert found.torn == 0
    again = path.with_stem("again")
    write_references(again, found.references)
    assert again.read_bytes() == path.read_bytes()


def test_the_binary_log_keeps_every_bit(tmp_path: Path) -> None:
    """A NaN with a payload, a negative zero, a denormal number."""
    odd = np.array([struct.unpack("<d", struct.pack("<Q", 0x7FF8_0000_0000_1234))[0], -0.0, 5e-324])
    write_references(tmp_path / "a.qpref", [JointReference(0, 0.0, odd, -odd)])
    (found,) = read_references(tmp_path / "a.qpref").references
    assert found.q.tobytes() == odd.tobytes()
    assert found.qd.tobytes() == (-odd).tobytes()


@pytest.mark.parametrize("ending", ENDINGS)
def test_a_controllers_references_go_through(ending: str, tmp_path: Path) -> None:
    robot = qpsafe.load_robot("irb140")
    controller = qpsafe.SafetyController(
        robot, [qpsafe.PositionTask("tcp", qpsafe.FixedPose(robot.pose("tcp", robot.home)))]
    )
    ticks = [controller.step(robot.home, np.zeros(6), points=np.zeros((0, 3))).reference for _ in range(3)]
    write_references(tmp_path / f"run{ending}", ticks)
    assert read_references(tmp_path / f"run{ending}").references == ticks


@pytest.mark.parametrize("ending", first(1, ENDINGS))
def test_a_crash_at_any_byte_loses_at_most_the_last_record(ending: str, tmp_path: Path) -> None:
    log = some(n=2)
    write_references(tmp_path / f"log{ending}", log)
    data = (tmp_path / f"log{ending}").read_bytes()
    kind = FORMATS[ending]
    ends = np.cumsum([len(kind.header(2))] + [len(kind.record(r, 2)) for r in log])
    assert ends[-1] == len(data)
    part = tmp_path / f"crashed{ending}.part"
    for size in range(ends[0], len(data)):
        part.write_bytes(data[:size])
        whole = int(np.searchsorted(ends, size, side="right")) - 1
        found = read_references(part)
        assert found.references == log[:whole]
        assert found.torn == size - ends[whole]


@pytest.mark.parametrize("ending", ENDINGS)
def test_a_log_has_its_name_only_when_it_is_whole(ending: str, tmp_path: Path) -> None:
    path, log = tmp_path / f"log{ending}", some()
    with ReferenceWriter(path, 6) as writer:
        for reference in log:
            writer.write(reference)
        assert not path.exists()
        assert writer.count == len(log)
    assert [p.name for p in tmp_path.iterdir()] == [path.name]
    assert read_references(path).references == log


@pytest.mark.parametrize("beside", [False, True])
@pytest.mark.parametrize("ending", ENDINGS)
@pytest.mark.parametrize("old", [None, b"whatever was there"])
@pytest.mark.parametrize("fails", [False, True])
def test_where_nothing_was_recorded_an_older_file_stays_and_none_is_made(
    old: bytes | None, ending: str, beside: bool, fails: bool, tmp_path: Path
) -> None:
    path = tmp_path / f"log{ending}"
    if old is not None:
        path.write_bytes(old)
    with suppress(InterruptedError), ReferenceWriter(path, 6, beside=beside):
        if fails:
            raise InterruptedError
    assert [p.name for p in tmp_path.iterdir()] == ([] if old is None else [path.name])
    assert old is None or path.read_bytes() == old


def interrupt(path: Path) -> None:
    with ReferenceWriter(path, 6) as writer:
        writer.write(some()[0])
        raise KeyboardInterrupt


@pytest.mark.parametrize("ending", ENDINGS)
def test_an_interrupted_run_leaves_what_it_had(ending: str, tmp_path: Path) -> None:
    path = tmp_path / f"log{ending}"
    with pytest.raises(KeyboardInterrupt):
        interrupt(path)
    assert not path.exists()
    assert read_references(path.with_name(path.name + ".part")).references == some()[:1]


@pytest.mark.parametrize("ending", ENDINGS)
def test_writing_at_once_leaves_nothing_half_done(ending: str, tmp_path: Path) -> None:
    path = tmp_path / f"log{ending}"
    write_references(path, some())
    before = path.read_bytes()
    for bad in ([*some(), JointReference(9, 0.0, np.zeros(5), np.zeros(5))], []):
        with pytest.raises((ValueError, ConfigurationError)):
            write_references(path, bad)
        assert [p.name for p in tmp_path.iterdir()] == [path.name]
        assert path.read_bytes() == before


def test_flushed_records_are_on_disk_while_the_run_goes_on(tmp_path: Path) -> None:
    writer = ReferenceWriter(tmp_path / "log.qpref", 6)
    for _ in range(300):
        writer.write(some()[0])
    assert len(read_references(writer.part).references) >= 250
    writer.close()
    writer.close()  # once is enough, twice no harm


@pytest.mark.parametrize("name", ["log.txt", "log", "log.npz"])
def test_other_endings_are_refused_by_name(name: str, tmp_path: Path) -> None:
    with pytest.raises(ConfigurationError, match=r"\.csv or \.qpref"):
        ReferenceWriter(tmp_path / name, 6)
    with pytest.raises(ConfigurationError, match=r"\.csv or \.qpref"):
        write_references(tmp_path / name, some())
    assert not list(tmp_path.iterdir())


def test_a_damaged_binary_log_says_where(tmp_path: Path) -> None:
    path = tmp_path / "log.qpref"
    write_references(path, some())
    data = bytearray(path.read_bytes())
    first = 16 + 117
    data[first + 30] ^= 1
    path.write_bytes(data)
    with pytest.raises(ReferenceLogError, match=f"record 1, at byte {first}, is damaged"):
        read_references(path)


@pytest.mark.parametrize(
    ("old", "new", "where"),
    [
        ("posRef_1 [rad]", "posRef_1 [deg]", "line 1"),
        ("\n1,", "\none,", "line 3"),
        ("\n2,0.008,1", "\n2,0.008,yes", "line 4: active = 'yes'"),
        ("\n1,", "\n1,1,", "line 3: 40 cells"),
    ],
)
def test_a_damaged_csv_log_says_where(old: str, new: str, where: str, tmp_path: Path) -> None:
    path = tmp_path / "log.csv"
    write_references(path, some())
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new, 1))
    with pytest.raises(ReferenceLogError, match=where):
        read_references(path)


def test_half_of_the_gains_are_none(tmp_path: Path) -> None:
    path = tmp_path / "log.csv"
    write_references(path, [some()[-1]])
    header, line = path.read_text().splitlines()
    path.write_text(header + "\n" + ",".join(line.split(",")[:-6] + [""] * 6) + "\n")
    with pytest.raises(ReferenceLogError, match="line 2: some of the gains are missing"):
        read_references(path)


@pytest.mark.parametrize("ending", ENDINGS)
@pytest.mark.parametrize("data", [b"", b"hello\nworld\n", b"\x00" * 64, b"QPSREF1\n"])
def test_other_files_are_no_logs(data: bytes, ending: str, tmp_path: Path) -> None:
    path = tmp_path / f"log{ending}"
    path.write_bytes(data)
    with pytest.raises(ReferenceLogError, match=r"no .* log of joint references"):
        read_references(path)


def test_references_are_equal_by_their_numbers() -> None:
    a, b = some(), some()
    assert a == b
    assert a[0] != a[1]
    gains = ServoGains(*np.ones((3, 6)))
    q = np.zeros(6)
    kinds = [JointReference(0, 0.0, q, q, True, torque, g) for torque in (None, q) for g in (None, gains)]
    assert [[x == y for y in kinds] for x in kinds] == np.eye(4, dtype=bool).tolist()
    assert JointReference(0, 0.0, q, q) != "a reference"


@pytest.mark.parametrize("ending", ENDINGS)
def test_beside_the_loop_the_log_is_the_same(ending: str, tmp_path: Path) -> None:
    references = some(600)
    for beside in (False, True):
        with ReferenceWriter(tmp_path / f"{beside}{ending}", 6, beside=beside) as writer:
            for each in references:
                writer.write(each)
                assert writer.trouble(0.004 * each.seq) == ""
    assert (tmp_path / f"True{ending}").read_bytes() == (tmp_path / f"False{ending}").read_bytes()


@pytest.mark.parametrize("ending", ENDINGS)
@pytest.mark.parametrize("room", [0, 100, 20000, 30001])
def test_a_disk_that_fills_up_is_told_and_what_fits_is_read(ending: str, room: int, tmp_path: Path) -> None:
    """Nothing raises in the loop; what was written keeps the name of a log that was not finished."""
    path = tmp_path / f"run{ending}"
    writer = ReferenceWriter(path, 6, beside=True)
    outlet, left = writer._outlet, [room]
    assert outlet is not None
    while not outlet._told:  # the header is there
        time.sleep(0.001)

    def write(piece: memoryview) -> int:
        if left[0] == 0:
            raise OSError(errno.ENOSPC, "No space left on device")
        taken = min(len(piece), left[0])
        left[0] -= taken
        return writer._file.write(piece[:taken])

    outlet._put = write
    log = some(1000)
    with writer:
        for each in log:
            writer.write(each)
    assert "No space left" in writer.trouble(0.0)
    assert not path.exists()
    found = read_references(writer.part).references
    assert found == log[: len(found)]
    assert (len(found) > 50) == (room >= 20000)
