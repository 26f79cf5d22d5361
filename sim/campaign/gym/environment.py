"""An encounter as a `gymnasium.Env`: a policy moves the robot, the campaign's measures say how it went.

Importing this module registers `ID`. Needs the extra "gym".
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from qpsafe.errors import ConfigurationError
from qpsafe.extras import require
from qpsafe.limits import JointLimits
from qpsafe.recovery.recovery import FOLLOWING, SUSPENDED
from qpsafe.sim.campaign.plan import Plan
from qpsafe.sim.campaign.trials.measures import measures
from qpsafe.sim.campaign.trials.meeting import meeting
from qpsafe.sim.campaign.trials.recording import STATUSES, Recording
from qpsafe.sim.campaign.trials.senses import Senses
from qpsafe.sim.campaign.trials.servo import DT, Servo
from qpsafe.tasks.rotation import log3
from qpsafe.text.given import flag, numbers
from qpsafe.tick import BAD_INPUT, OK

require("gym", "the environment", "gymnasium")
import gymnasium  # noqa: E402
from gymnasium.spaces import Box, Dict  # noqa: E402

if TYPE_CHECKING:
    from qpsafe.robot.robot import Robot
    from qpsafe.sim.campaign.trials.meeting import Meeting
    from qpsafe.sim.campaign.trials.station import Station
    from qpsafe.tick import Tick

Array = NDArray[np.float64]
Observation = dict[str, Array]

ID = "qpsafe/Encounter-v0"
ON_PATH = 0.02  # [m]
CAREFUL, HARM, TOUCH = 0.2, 1.0, 100.0  # [m], reward per tick at distance 0, reward
UNUSABLE = -1.0  # in the place of a reading that is no number
OVERSHOOT = 1.0 + 2.0 * math.exp(-2.0)  # ∫|h| of a servo with a lag, h its impulse response ω (2 - ω t) exp(-ω t)
MOST = 10.0  # of errors and twists [m, rad, m/s, rad/s]
DRAWN = (2**24, 2**31)  # seeds of encounters that nobody asked for by number: none of those that campaigns begin with
LARGEST = 1e6  # what is larger in an action is taken for so much: its velocity is finite, too
_EXACT = 1.0 + 1e-9


def scale(robot: Robot) -> Array:
    """Joint velocities of the action 1, (n,) [rad/s]: the powers of two that reach the limits, so no bit is lost."""
    return np.asarray(2.0 ** np.ceil(np.log2(robot.max_velocity)))


class EncounterEnv(gymnasium.Env[Observation, Array]):
    """One robot at its work among people who come; encounters are those of a campaign with the same seeds.

    An action times `scale(robot)` is a velocity for every joint, (n,) in [-1, 1]. Whatever is asked for is brought
    inside position, velocity and acceleration limits, as a controller's commands are; with a number that is not finite
    in it, the whole action counts for nothing and the robot brakes. `info` says both.

    The work's clock goes on while the tool is within `ON_PATH` of its reference, no faster than for an undisturbed
    robot. Reward of a tick: 1 if it goes on, minus up to `HARM` for people nearer than `CAREFUL`, minus `TOUCH`
    at the first contact.

    Args:
        robot: A bundled robot or a path.
        motion: ``hold``, ``line``, ``pick``, or the path of a program.
        sensor: ``ideal`` or ``sharp``.
        lag: Delay of the servos [s].
        people: A TOML file with a model of people, None for the bundled one.
        stop_at_contact: Whether a contact ends the episode; a campaign's trials go on.

    Raises:
        ConfigurationError: A value is none of these.
    """

    metadata: ClassVar[dict[str, Any]] = {"render_modes": []}
    _q: Array
    _command: Array

    def __init__(
        self, robot: str = "irb140", motion: str = "hold", sensor: str = "ideal", lag: float = 0.0,
        people: str | None = None, stop_at_contact: bool = True,
    ) -> None:  # fmt: skip
        if sensor not in ("ideal", "sharp"):
            raise ConfigurationError("EncounterEnv", "sensor", sensor, "ideal or sharp")
        self._plan = Plan(robot=robot, motions=(motion,), sensor=sensor, lag=lag, people=people, controllers=("none",))
        self._stop_at_contact = flag("EncounterEnv", "stop_at_contact", stop_at_contact)
        self._told: Tick | None = None
        self._rows: list[tuple[Any, ...]] = []
        self._begin(0)
        self._over = True  # until it is reset
        arm, k = self.station.robot, len(self.station.spots)
        self._limits = JointLimits.of(arm, DT)
        self._range = self.station.spots.range_max
        most = OVERSHOOT if lag > 0.0 else _EXACT
        middle, half = 0.5 * (arm.upper + arm.lower), 0.5 * (arm.upper - arm.lower)
        fastest, six = arm.max_velocity, np.full(6, MOST)
        self.action_space = Box(-1.0, 1.0, (arm.nq,), np.float64)
        self._scale = scale(arm)
        self.observation_space = Dict({
            "q": Box(middle - most * half, middle + most * half, dtype=np.float64),
            "qd": Box(-most * fastest, most * fastest, dtype=np.float64),
            "command": Box(-_EXACT * fastest, _EXACT * fastest, dtype=np.float64),
            "distances": Box(np.full(k, UNUSABLE), self._range, dtype=np.float64),
            "error": Box(-six, six, dtype=np.float64),
            "twist": Box(-six, six, dtype=np.float64),
        })  # fmt: skip

    @property
    def station(self) -> Station:
        """Robot, cell and work, the same in all episodes."""
        return self._met.station

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observation, dict[str, Any]]:
        """Begin an encounter: that of `seed`, else one drawn by the environment's own generator.

        Args:
            seed: As a campaign's trials have.
            options: Not used.
        """
        super().reset(seed=seed)
        self._begin(int(self.np_random.integers(*DRAWN)) if seed is None else int(seed))
        return self._observe(), {"seed": self._met.seed}

    def tell(self, tick: Tick) -> None:
        """What a policy that is a controller says about its next action: its own clock, phase, points and status.

        Rows of measures take them from it, as a campaign does, instead of what the environment thinks.
        """
        self._told = tick

    def step(self, action: ArrayLike) -> tuple[Observation, float, bool, bool, dict[str, Any]]:
        """Move for a tick of 4 ms.

        Raises:
            ConfigurationError: The action is no array (n,) of real numbers; or no encounter has begun, or it ended.
        """
        if self._over:
            raise ConfigurationError(
                "EncounterEnv", "step", "no encounter", "reset() first: none has begun, or it ended"
            )
        wish = numbers("EncounterEnv", "action", action, f"{len(self._command)} real numbers", ndim=1)
        if wish.shape != self._command.shape:
            raise ConfigurationError("EncounterEnv", "action", wish.shape, f"an action of shape {self._command.shape}")
        usable = bool(np.isfinite(wish).all())
        asked = np.clip(wish, -LARGEST, LARGEST) * self._scale if usable else np.zeros_like(wish)
        box = self._limits.box(self._q, self._command)
        command, outside = box.admit(asked)
        working = self._advance()
        seen = self._senses.people_seen(self._servo.q)
        said: tuple[Any, ...] = (FOLLOWING if working else SUSPENDED, self._time, OK if usable else BAD_INPUT, seen)
        if self._told is not None:
            said = self._told.phase, self._told.path_time, self._told.status, self._told.points
            self._told = None
        self._q, self._command = self._q + command * DT, command
        self._rows.append((self._servo.q, self._servo.qd, self._q, command, *said))
        self._servo.follow(self._q, command)
        self._k += 1
        observation = self._observe()
        place, tracks, k = self.station, self._met.tracks, min(self._k, len(self._met.tracks) - 1)
        distance = place.distances.people(place.robot.at(self._servo.q).body_poses(), tracks.row(k)).distance
        touched = distance <= 0.0 and not self._touched and self._k < len(tracks)
        self._touched |= touched
        terminated = touched and self._stop_at_contact
        truncated = self._k >= len(tracks) and not terminated
        self._over = terminated or truncated
        reward = float(working) - HARM * max(1.0 - max(distance, 0.0) / CAREFUL, 0.0) - TOUCH * touched
        info: dict[str, Any] = {
            "distance": distance, "contact": self._touched, "outside_limits": outside, "bad_action": not usable
        }  # fmt: skip
        if self._over:
            info["measures"] = self.measures()
        return observation, reward, terminated, truncated, info

    def measures(self, name: str = "policy") -> dict[str, Any]:
        """The row of the encounter up to now, see `qpsafe.sim.campaign.trials.rows`.

        Args:
            name: In the column ``controller``; a campaign's controller also gives the column ``sensor``.
        """
        if not self._rows:
            raise ConfigurationError("EncounterEnv", "measures", "no tick yet", "an encounter that has begun")
        rows = self._rows
        if self._touched and self._stop_at_contact:  # the tick of the contact belongs to it
            rows = [*rows, (self._servo.q, self._servo.qd, *rows[-1][2:])]
        q, qd, ref, ref_qd, phase, time, status, seen = zip(*rows, strict=True)
        marks = np.array([STATUSES.index(word) for word in status], dtype=np.int64)
        run = Recording(
            DT, np.array(q), np.array(qd), np.array(ref), np.array(ref_qd), np.array(phase), np.array(time), marks,
            list(seen),
        )  # fmt: skip
        return measures(self._plan, self._met, name, run)

    def _begin(self, seed: int) -> None:
        self._met: Meeting = meeting(self._plan, seed)
        place = self.station
        self._senses = Senses(place, self._met.tracks, self._plan.sensor, seed)
        self._servo = Servo(place.start, self._plan.lag)
        self._q, self._command = place.start.copy(), np.zeros(place.robot.nq)
        self._k, self._time, self._touched, self._over = 0, 0.0, False, False
        self._told, self._rows = None, []

    def _advance(self) -> bool:
        """Let the work's clock go on if the tool is where it should be."""
        if not float(np.linalg.norm(self._error[:3])) <= ON_PATH:
            return False
        self._time = min(self._time + DT, self.station.nominal(self._k + 1))
        return True

    def _observe(self) -> Observation:
        q, qd, robot = self._servo.q, self._servo.qd, self.station.robot
        readings = self._senses.distances(q, min(self._k, len(self._met.tracks) - 1))
        readings = np.where(np.isnan(readings), UNUSABLE, np.minimum(readings, self._range))
        sample, pose = self.station.reference.sample(self._time), robot.pose(robot.tool_frames[0], q)
        turn = log3(sample.pose[:3, :3] @ pose[:3, :3].T)
        self._error = np.concatenate((sample.pose[:3, 3] - pose[:3, 3], turn))
        return {
            "q": q.copy(), "qd": qd.copy(), "command": self._command.copy(), "distances": readings,
            "error": np.clip(self._error, -MOST, MOST), "twist": np.clip(sample.twist, -MOST, MOST),
        }  # fmt: skip


gymnasium.register(ID, entry_point=EncounterEnv)
