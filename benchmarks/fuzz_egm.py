"""Fuzz what a robot may send: python benchmarks/fuzz_egm.py [--datagrams N] [--atheris RUNS] [--out FILE].

Datagrams, most of them made from valid packets, go into a session that drives a robot. None may raise; one that is
refused may change nothing but its count; one that is accepted must mean the same to an independent message module.
With --atheris, coverage chooses the datagrams (pip install atheris).
"""

from __future__ import annotations

import argparse
import importlib
import importlib.util
import subprocess
import sys
import tempfile
import time
from collections import Counter
from pathlib import Path
from random import Random

import numpy as np

from qpsafe.cli.outputs import try_file
from qpsafe.irc5.messages import MCI_STATES, RAPID_STATES, RobotPacket, encode_robot
from qpsafe.irc5.session import EgmSession
from qpsafe.irc5.transport.inbox import REFUSALS
from qpsafe.limits import JointLimits
from qpsafe.text.json_text import json_text

N, DT = 6, 0.004
LIMITS = JointLimits(np.full(N, -3.0), np.full(N, 3.0), np.full(N, 3.0), np.full(N, 10.0), DT)
ROBOT = ("127.0.0.1", 5000)
try:
    # it has the fields that ours has; both load together, since ours has names of its own
    OTHER = importlib.import_module("abb_robot_client._egm_protobuf.egm_pb2")
except ImportError:
    OTHER = None


def valid(random: Random, seq: int, clock: float) -> bytes:
    """A packet of a robot somewhere."""
    q = np.array([random.uniform(-1.0, 1.0) for _ in range(N)])
    return encode_robot(RobotPacket(seq, 4 * seq, q, q if random.random() < 0.5 else None, clock=clock))


def random_bytes(random: Random, packet: bytes) -> bytes:
    return random.randbytes(random.randrange(300))


def flipped_bits(random: Random, packet: bytes) -> bytes:
    data = bytearray(packet)
    for _ in range(random.randrange(1, 6)):
        data[random.randrange(len(data))] ^= 1 << random.randrange(8)
    return bytes(data)


def changed_bytes(random: Random, packet: bytes) -> bytes:
    data = bytearray(packet)
    for _ in range(random.randrange(1, 4)):
        data[random.randrange(len(data))] = random.choice((0, 0xFF, 0x7F, 0x80, 1))
    return bytes(data)


def truncated(random: Random, packet: bytes) -> bytes:
    return packet[: random.randrange(len(packet))]


def cut_and_moved(random: Random, packet: bytes) -> bytes:
    a, b, c = sorted(random.randrange(len(packet) + 1) for _ in range(3))
    moved = packet[:a] + packet[b:c] + packet[a:b] + packet[c:]
    return random.choice((packet[:a] + packet[b:], packet[:b] + packet[a:], moved))


def huge_varint(random: Random, packet: bytes) -> bytes:
    place = random.randrange(len(packet) + 1)
    return packet[:place] + b"\xff" * random.randrange(1, 20) + b"\x7f" + packet[place:]


def deeply_nested(random: Random, packet: bytes) -> bytes:
    data = b""
    for _ in range(random.randrange(1, 120)):
        data = bytes([random.choice((0x0A, 0x12, 0x1A, 0x22, 0x2A, 0x42))]) + _varint(len(data)) + data
    return data + packet * random.randrange(2)


def too_long(random: Random, packet: bytes) -> bytes:
    return packet * random.randrange(2, 60)


def odd_numbers(random: Random, packet: bytes) -> bytes:
    """Valid as a message, but not as a robot."""
    n = N if random.random() < 0.5 else random.randrange(12)
    odd = np.array([random.choice((np.nan, np.inf, -np.inf, 1e306, -1e6, 0.0, 5e-324)) for _ in range(n)])
    clock = random.choice((None, 0.0, 1e9, 1.8e13))
    return encode_robot(RobotPacket(random.randrange(2**32), 0, odd, odd, clock=clock))


def replayed(random: Random, packet: bytes) -> bytes:
    """An old packet, delayed."""
    return valid(random, random.randrange(2), 1e6)


def _varint(value: int) -> bytes:
    data = bytearray()
    while value > 127:
        data.append(value & 127 | 128)
        value >>= 7
    return bytes([*data, value])


MUTATORS = (
    random_bytes,
    flipped_bits,
    changed_bytes,
    truncated,
    cut_and_moved,
    huge_varint,
    deeply_nested,
    too_long,
    odd_numbers,
    replayed,
)


class Target:
    """A session that drives a robot, and what must hold of it."""

    def __init__(self, seed: int = 0) -> None:
        self.random = Random(seed)
        self.counts: Counter[str] = Counter()
        self.start()

    def start(self) -> None:
        """A new session, in its ramp."""
        self.session, self.seq, self.now = EgmSession(LIMITS), 0, 0.0
        self.exchange()

    def exchange(self) -> None:
        """A valid packet, answered; the next one is there to be mutated."""
        self.seq += 1
        self.now += DT
        assert self.session.offer(valid(self.random, self.seq, 1e6 + self.now), ROBOT, self.now)
        assert self.session.take() is not None
        assert self.session.answer(None) is not None
        self.next = valid(self.random, self.seq + 1, 1e6 + self.now + DT)

    def state(self) -> tuple:
        """Everything that a refused datagram must leave alone."""
        s, box = self.session, self.session.inbox
        arrays = (s.q.tobytes(), s.qd.tobytes(), s._recent.tobytes())
        known = (box.sender, box._last, box._last_time, tuple(box._proof))
        return (s.phase, s.causes, s._seq, s._arrival, s._anew, s._missed, s._cycle, *known, *arrays)

    def check(self, data: bytes, sender: tuple[str, int] = ROBOT) -> None:
        """Offer a datagram, and judge what became of it."""
        before, refused = self.state(), self.refused()
        if not self.session.offer(data, sender, self.now):
            assert self.state() == before
            assert self.refused() == refused + 1
            return
        assert sender == ROBOT
        self.counts["accepted"] += 1
        cycle = self.session.take()
        assert cycle is not None
        judge(data, cycle.packet)
        assert self.session.answer(None) is not None
        assert np.isfinite(self.session.q).all()
        self.renew()

    def refused(self) -> int:
        """How many datagrams this session has refused."""
        return sum(self.session.counts[reason] for reason in REFUSALS)

    def renew(self) -> None:
        """Keep the counts, and start a new session."""
        self.counts.update({reason: self.session.counts[reason] for reason in REFUSALS})
        self.start()


def judge(data: bytes, packet: RobotPacket) -> None:
    """What we accepted is valid by the other module, and says the same there."""
    if OTHER is None:
        return
    said = OTHER.EgmRobot()
    said.MergeFromString(data)
    assert (said.header.seqno, said.header.tm, said.header.mtype) == (packet.seq, packet.time_ms, 2)
    assert np.array_equal(np.deg2rad(said.feedBack.joints.joints), packet.q)
    assert np.isfinite(packet.q).all()
    assert len(packet.q) == N
    assert packet.clock == (said.feedBack.time.sec * 10**6 + said.feedBack.time.usec) / 1e6
    assert packet.motors_on == (said.motorState.state == 1)
    assert packet.mci == MCI_STATES[said.mciState.state]
    assert packet.rapid == RAPID_STATES[said.rapidExecState.state]


def fuzz(datagrams: int, seed: int = 0, progress: bool = False) -> dict[str, object]:
    """Fuzz by mutation; the report. Raises AssertionError where something does not hold."""
    random, target = Random(seed), Target(seed)
    made: Counter[str] = Counter()
    start = time.perf_counter()
    for k in range(datagrams):
        mutate = MUTATORS[k % len(MUTATORS)]
        made[mutate.__name__] += 1
        sender = ROBOT if k % 31 else ("127.0.0.1", random.randrange(5000))
        try:
            target.check(mutate(random, target.next), sender)
        except Exception:
            print(f"datagram {k} by {mutate.__name__}, seed {seed}", file=sys.stderr)
            raise
        if k % 50 == 0:
            target.exchange()
        if progress and k % 10_000 == 0 and sys.stderr.isatty():
            print(f"\r{k:,} of {datagrams:,}", end="", file=sys.stderr, flush=True)
    if progress and sys.stderr.isatty():
        print("\r" + 30 * " ", end="\r", file=sys.stderr)
    target.renew()
    return {
        "datagrams": datagrams,
        "seed": seed,
        "made": dict(made),
        "became": dict(target.counts),
        "seconds": time.perf_counter() - start,
        "judged_by": OTHER.__name__ if OTHER else None,
        "ok": sum(target.counts.values()) == datagrams,
    }


def fuzz_by_coverage(runs: int, corpus: str | None) -> int:
    """Fuzz with atheris in a process of its own, which atheris ends; its exit code, 0 if nothing was found."""
    if importlib.util.find_spec("atheris") is None:
        print("atheris is not installed: pip install atheris", file=sys.stderr)
        return 1
    if corpus is None:
        target, random = Target(), Random(0)
        with tempfile.TemporaryDirectory() as folder:  # what it starts from
            for k, mutate in enumerate([*MUTATORS, lambda _, packet: packet]):
                Path(folder, str(k)).write_bytes(mutate(random, target.next))
            return subprocess.call([sys.executable, __file__, "--atheris", str(runs), "--corpus", folder])

    import atheris

    for name in ("qpsafe.irc5.messages", "qpsafe.irc5.transport.inbox", "qpsafe.irc5.session"):
        for thing in vars(sys.modules[name]).values():
            if getattr(thing, "__module__", None) == name:
                for function in vars(thing).values() if isinstance(thing, type) else [thing]:
                    if hasattr(function, "__code__"):
                        atheris.instrument_func(function)
    atheris.Setup([sys.argv[0], f"-runs={runs}", "-max_len=600", f"-artifact_prefix={corpus}/", corpus], Target().check)
    atheris.Fuzz()
    return 0


def main() -> None:
    """Run from the command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--datagrams", type=int, default=1_000_000)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--atheris", type=int, metavar="RUNS", help="let coverage choose the datagrams instead")
    parser.add_argument("--corpus", help=argparse.SUPPRESS)
    parser.add_argument("--out", type=Path, help="write the report to this file")
    arguments = parser.parse_args()
    if arguments.out:
        try_file("fuzz_egm", "--out", arguments.out)
    if arguments.atheris:
        sys.exit(fuzz_by_coverage(arguments.atheris, arguments.corpus))
    report = fuzz(arguments.datagrams, arguments.seed, progress=True)
    judge = report["judged_by"] or "nobody else"
    print(f"{report['datagrams']:,} datagrams in {report['seconds']:.0f} s, judged by {judge}")
    for title in ("made", "became"):
        print(f"{title}:")
        for name, count in sorted(report[title].items(), key=lambda item: -item[1]):  # type: ignore[attr-defined]
            print(f"  {count:10,} {name}")
    print(
        "no exception, no state changed by what was refused"
        if report["ok"]
        else "some datagrams were not accounted for"
    )
    if arguments.out:
        arguments.out.write_text(json_text(report) + "\n", encoding="utf-8")
    sys.exit(0 if report["ok"] else 1)


if __name__ == "__main__":
    main()
