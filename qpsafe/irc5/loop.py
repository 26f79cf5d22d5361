"""What happens between a packet of the robot and its answer: controller, session and supervisor, without a socket.

    cycle of the session ──robot's states──> supervisor <──health of the sensors── controller
    cycle + distances ──controller.step──> reference ──session──> answer

The session decides what the robot may be sent; the supervisor decides whether it may be moved, and says why not.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from qpsafe.errors import ConfigurationError
from qpsafe.irc5.messages import RobotPacket
from qpsafe.irc5.session import Cycle, EgmSession, Phase
from qpsafe.irc5.supervisor import State, StopCategory, Supervisor
from qpsafe.text.given import flag, number, of_kind, whole
from qpsafe.tick import BAD_INPUT, FAULT, Tick

if TYPE_CHECKING:
    from qpsafe.controller import SafetyController
    from qpsafe.reference import JointReference

Array = NDArray[np.float64]

#: Causes that begin so are the robot's own: it was switched off, its program stopped or started anew, it fell silent.
ROBOT = "robot: "

_NOTHING = np.empty((0, 3))


@dataclass(frozen=True)
class LoopRules:
    """When the loop stops the robot, and what lets it go on.

    Attributes:
        silence: Without a packet for this long, the stream is stopped [s].
        bad_ticks: Unusable ticks in a row (bad input, or a failed controller) after which it is stopped; the robot
            brakes from the first.
        settle: How long a pose at rest is sent before falling silent [s].
        manual: Whether also a stop that the robot itself made needs an acknowledgement here; else its own start, by
            the robot's rules, counts as one.

    Raises:
        ConfigurationError: A time is no finite number > 0, the number of ticks not whole or < 1, or `manual` neither
            True nor False.
    """

    silence: float = 0.1
    bad_ticks: int = 5
    settle: float = 0.2
    manual: bool = False

    def __post_init__(self) -> None:
        for name in ("silence", "settle"):
            number("LoopRules", name, getattr(self, name), "a finite number > 0", above=0.0)
        whole("LoopRules", "bad_ticks", self.bad_ticks, "a whole number, 1 to 10^9", 1, 10**9)
        flag("LoopRules", "manual", self.manual)


class StreamLoop:
    """One stream of references.

    Args:
        controller: Makes them.
        session: Sends them.
        supervisor: Watches over both.
        rules: When to stop.

    Raises:
        ConfigurationError: A joint slides, while the wire has angles; or more silence is borne than by the session; or
            an argument is something else.

    Attributes:
        tick: Of the controller, the last one; None before.
        measured: Where the robot was in the last cycle (n,) [rad]; None before.
        events: Names of the task program's events since they were last taken.
    """

    def __init__(
        self,
        controller: SafetyController,
        session: EgmSession,
        supervisor: Supervisor | None = None,
        rules: LoopRules | None = None,
    ) -> None:
        if not (hasattr(controller, "robot") and callable(getattr(controller, "step", None))):
            raise ConfigurationError("StreamLoop", "controller", controller, "a SafetyController")
        of_kind("StreamLoop", "session", session, EgmSession)
        robot = controller.robot
        if robot.sliding.any():
            which = [name for name, slides in zip(robot.joint_names, robot.sliding, strict=True) if slides]
            raise ConfigurationError("StreamLoop", "robot", which, "joints that turn: EGM's joints are angles")
        self.controller, self.session = controller, session
        self.supervisor = Supervisor() if supervisor is None else supervisor
        self.rules = LoopRules() if rules is None else rules
        of_kind("StreamLoop", "supervisor", self.supervisor, Supervisor)
        of_kind("StreamLoop", "rules", self.rules, LoopRules)
        most = session.rules.silence
        if self.rules.silence > most:  # the robot would be held after that all the same, as one that was started anew
            expected = f"at most the session's, {most:g} s: a packet after that is a new start"
            raise ConfigurationError("StreamLoop", "silence", self.rules.silence, expected)
        self.tick: Tick | None = None
        self.measured: Array | None = None
        self.events: list[str] = []
        self._anew = True  # the controller must start from the measured pose
        self._restarted = False  # the robot has, since the last stop
        self._bad = 0
        self._settled = 0

    # what comes from outside

    def stop(self, category: StopCategory, cause: str) -> None:
        """Bring the robot to rest, or with category 0 fall silent."""
        self.supervisor.stop(category, cause)
        self.session.stop(cause)

    def acknowledge(self, cause: str = "operator") -> bool:
        """A person has seen to what was wrong; returns whether that changed anything."""
        if not self.supervisor.acknowledge(cause):
            return False
        self.controller.acknowledge()
        self.session.acknowledge()
        self._bad = 0
        return True

    def silent(self, seconds: float) -> None:
        """Nothing has come from the robot for this long."""
        if seconds > self.rules.silence and self.supervisor.moving:
            self.stop(StopCategory.CONTROLLED_AND_HELD, f"{ROBOT}silent for {self.rules.silence:g} s")

    @property
    def leaving(self) -> bool:
        """Whether the stream ends: there is a stop of category 0 or 1."""
        category = self.supervisor.category
        return category is not None and category <= StopCategory.CONTROLLED_THEN_SILENT

    @property
    def over(self) -> bool:
        """Whether nothing more is to be sent: after category 0, or when a stop of category 1 has settled."""
        if not self.supervisor.silent:
            return False
        immediate = self.supervisor.category is StopCategory.IMMEDIATE
        return immediate or self._settled * self.controller.dt >= self.rules.settle

    # one cycle

    def step(self, cycle: Cycle, distances: Array | None = None, ages: Array | None = None) -> JointReference | None:
        """The reference to answer a cycle with, None where the session needs none. Never raises on data.

        Args:
            cycle: From the session.
            distances: Readings of the spots (k,) [m]; None for a robot without.
            ages: How old they are (k,) [s].
        """
        self._watch_robot(cycle)
        self.measured = cycle.packet.q
        supervisor = self.supervisor
        # a reference that still gives way to what holds the robot is not at rest
        self._settled = self._settled + 1 if supervisor.state is State.STOPPED and self.session.at_rest else 0
        if not supervisor.moving or not cycle.moving:
            if supervisor.state is State.STOPPED:
                self._observe(cycle, distances, ages)
            return None
        if not self._sees(distances, ages):
            return None
        if self._anew or cycle.seeded:
            self._anew = False
            self.controller.reseed()
            self.controller.resume()
        tick = self.tick = self._control(cycle, distances, ages)
        self.events.extend(tick.events)
        self._watch_controller(tick)
        return tick.reference

    def take_events(self) -> list[str]:
        """Events since the last call."""
        events, self.events = self.events, []
        return events

    def _sees(self, distances: Array | None, ages: Array | None) -> bool:
        """Whether there have been distances at all: before the first, the robot is held, not stopped."""
        if self.tick is not None or distances is None or ages is None:
            return True
        return bool(np.isfinite(ages).any())

    def _observe(self, cycle: Cycle, distances: Array | None, ages: Array | None) -> None:
        """While stopped, let the controller see with its path at rest, so that it knows when the sensors work again."""
        self._anew = True
        self.controller.pause()
        self.controller.reseed()
        self.tick = self._control(cycle, distances, ages)

    def _control(self, cycle: Cycle, distances: Array | None, ages: Array | None) -> Tick:
        """The controller's tick; without sensors nothing is in sight."""
        if distances is None:
            return self.controller.step(cycle.packet.q, cycle.qd, points=_NOTHING)
        return self.controller.step(cycle.packet.q, cycle.qd, distances, ages=ages)

    def _watch_robot(self, cycle: Cycle) -> None:
        supervisor, session = self.supervisor, self.session
        closed = gate(cycle.packet)
        if cycle.seeded:
            self._restarted = True
            if supervisor.moving and supervisor.state is not State.STOPPING:
                cause = ROBOT + (", ".join(closed) or "started anew")
                supervisor.stop(StopCategory.CONTROLLED_AND_HELD, cause)
                if self.rules.manual:
                    session.stop(cause)
        if session.causes and supervisor.moving:  # the session's own: the robot does not follow, or a reference jumped
            for cause in session.causes:
                supervisor.stop(StopCategory.CONTROLLED_AND_HELD, cause)
        if supervisor.state is State.STOPPING and session.phase not in (Phase.STOPPING, Phase.WAITING):
            supervisor.standstill("the reference is at rest")
        robots = all(cause.startswith(ROBOT) for cause in (*supervisor.causes, *session.causes))
        if supervisor.state is State.STOPPED and robots and not closed and self._restarted and not self.rules.manual:
            self.acknowledge(f"{ROBOT}started again")
        if supervisor.state is State.IDLE and cycle.moving:
            self._restarted = False
            self._anew = True
            supervisor.seed("motors on, motion control and RAPID running")
        if supervisor.state is State.SEEDING and cycle.phase is Phase.RUNNING:
            supervisor.run("references are ramped in")

    def _watch_controller(self, tick: Tick) -> None:
        bad = tick.status in (BAD_INPUT, FAULT)
        self._bad = self._bad + 1 if bad else 0
        if not (bad or tick.unseen):
            return
        known = self.supervisor.state.severity >= State.DEGRADED.severity
        if bad and self._bad >= self.rules.bad_ticks:
            message = tick.messages[0] if tick.messages else tick.status
            self.stop(StopCategory.CONTROLLED_AND_HELD, f"controller: {message}")
        elif not known:
            message = tick.messages[0] if tick.messages else ", ".join(tick.unseen)
            self.supervisor.degrade(f"controller: {message}")


def gate(packet: RobotPacket) -> list[str]:
    """What keeps the robot from being driven, in words."""
    found = [] if packet.motors_on else ["motors off"]
    if packet.mci != "running":
        found.append(f"motion control {packet.mci}")
    if packet.rapid != "running":
        found.append(f"RAPID {packet.rapid}")
    return found
