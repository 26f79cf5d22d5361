"""An EGM session: what holds whatever happens."""

from __future__ import annotations

import numpy as np
from amounts import some
from egm_wire import DT, LIMITS, N, Wire
from hypothesis import given, settings
from hypothesis import strategies as st

from qpsafe.irc5.messages import SensorPacket
from qpsafe.irc5.rules import SessionRules
from qpsafe.irc5.session import EgmSession
from qpsafe.reference import JointReference

# whatever happens

EVENTS = st.sampled_from(
    ["good"] * 8
    + ["lost", "duplicate", "stale", "restart", "silence", "motors off", "mci error", "rapid stopped", "junk", "moved"]
    + [
        "wrong sender",
        "no reference",
        "nan reference",
        "jumping reference",
        "fast reference",
        "stop",
        "acknowledge",
        "twice",
    ]
)


@settings(max_examples=some(10, of=60), deadline=None)
@given(events=st.lists(st.tuples(EVENTS, st.integers(1, 60)), max_size=40), data=st.data())
def test_whatever_happens_answers_are_finite_unique_and_never_jump(events: list, data: st.DataObject) -> None:
    wire = Wire(EgmSession(LIMITS, SessionRules(ramp_in=0.05, ramp_out=0.02)))
    junk = data.draw(st.binary(max_size=40))
    last: SensorPacket | None = None
    for event, times in events:
        for _ in range(times):
            wire.pass_time()
            if event == "lost":
                continue
            if event == "restart":
                wire.seq = 0
            if event == "silence":
                wire.pass_time(300)
            if event == "moved":
                wire.q = wire.q + 0.01
            if event == "stop":
                wire.session.stop("asked")
            if event == "acknowledge":
                wire.session.acknowledge()
            if event == "junk":
                assert not wire.offer(junk)
            if event == "wrong sender":
                wire.offer(wire.packet(), ("10.0.0.1", 1))
            if event == "stale":
                wire.offer(wire.packet(seq=(wire.seq - 5) % 2**32, clock=wire.clock - 5 * DT))
            changes = {"motors off": {"motors_on": False}, "mci error": {"mci": "error"}}.get(event, {})
            changes = {"rapid": "stopped"} if event == "rapid stopped" else changes
            measured = wire.q.copy()
            wire.offer(wire.packet(**changes))
            if event in ("duplicate", "twice"):
                wire.offer(wire.packet(**changes))
            q = wire.source.q if wire.source else wire.q
            odd = {
                "no reference": None,
                "nan reference": JointReference(1, 0.0, np.full(N, np.nan), np.zeros(N)),
                "jumping reference": JointReference(1, 0.0, -3.0 * q, np.zeros(N)),
                "fast reference": JointReference(1, 0.0, q, np.full(N, 99.0)),
            }
            answer = wire.answer(odd.get(event, "source"))
            if event == "twice":
                assert wire.answer() is None
            if answer is None:
                continue
            assert np.isfinite(answer.q_ref).all()
            if wire.cycles[-1].seeded and not wire.cycles[-1].moving:
                assert np.allclose(answer.q_ref, measured, rtol=1e-9, atol=1e-9)
                assert not answer.qd_ref.any()
            else:
                before = SensorPacket(0, 0, measured, np.zeros(N)) if wire.cycles[-1].seeded else last
                assert before is not None
                wire.answers[-2:] = [before, answer]
                wire.check_steps(len(wire.answers) - 2)
            last = answer
            wire.q = answer.q_ref.copy()
    counts = wire.session.counts
    assert counts["answered"] + counts["superseded"] == counts["accepted"]
