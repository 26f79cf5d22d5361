"""An encounter as a `gymnasium.Env`: a policy moves the robot, the campaign's measures say how it went.

    import gymnasium
    import qpsafe.sim.campaign.environment  # registers qpsafe/Encounter-v0
    env = gymnasium.make("qpsafe/Encounter-v0", motion="line")

Action: joint velocities as shares of their limits, (n,) in [-1, 1]; whatever is asked for is brought inside the joint
limits before the robot moves, as the controller's own commands are. Observation, (3 n + k + 12,): joint positions as
shares of their range, joint velocities as shares of their limits, what the spots read (their range where they see
nothing), the joints' command before, the first tool's error against its reference (m, rad) and the reference's twist.
The work's clock runs while the tool is within `ON_PATH` of its reference, and stands otherwise.

Reward of a tick: whether work was done, minus `HARM` times what comes nearer than `CAREFUL`, minus `TOUCH` at a
contact, which ends the episode. The row of measures is in ``info["measures"]`` when an episode is over.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, ClassVar

import gymnasium
import numpy as np
from numpy.typing import NDArray

from qpsafe.limits import JointLimits
from qpsafe.recovery.recovery import FOLLOWING, SUSPENDED
from qpsafe.sim.campaign.measures import measures
from qpsafe.sim.campaign.meeting import meeting
from qpsafe.sim.campaign.plan import Plan
from qpsafe.sim.campaign.recording import Recording
from qpsafe.sim.campaign.senses import Senses
from qpsafe.sim.campaign.servo import DT, Servo
from qpsafe.tasks.rotation import log3

if TYPE_CHECKING:
    from qpsafe.sim.campaign.meeting import Meeting

Array = NDArray[np.float64]

ID = "qpsafe/Encounter-v0"
ON_PATH = 0.02  # [m]
CAREFUL, HARM, TOUCH = 0.2, 1.0, 100.0  # [m], reward per tick at distance 0, reward


class EncounterEnv(gymnasium.Env[Array, Array]):
    """One robot among people; seeds are those of a campaign, so a policy can be compared with its controllers.

    Args:
        robot: A bundled robot or a path.
        motion: What it does, see `qpsafe.sim.campaign.station`.
        sensor: ``ideal`` or ``sharp``.
        lag: Of the servo [s].
        people: A TOML file with a model of people, None for the bundled one.
    """

    metadata: ClassVar[dict[str, Any]] = {"render_modes": []}

    def __init__(
        self, robot: str = "irb140", motion: str = "hold", sensor: str = "ideal", lag: float = 0.0,
        people: str | None = None,
    ) -> None:  # fmt: skip
        self._plan = Plan(robot=robot, motions=(motion,), sensor=sensor, lag=lag, people=people, controllers=("none",))
        self._begin(0)
        n, robot_ = self._n, self._met.station.robot
        self._centre, self._half = 0.5 * (robot_.upper + robot_.lower), 0.5 * (robot_.upper - robot_.lower)
        self._limits = JointLimits.of(robot_, DT)
        spots = self._senses.spots
        self._range = spots.range_max
        size = 3 * n + len(spots) + 12
        self.action_space = gymnasium.spaces.Box(-1.0, 1.0, (n,), np.float64)
        self.observation_space = gymnasium.spaces.Box(-np.inf, np.inf, (size,), np.float64)

    def _begin(self, seed: int) -> None:
        self._met: Meeting = meeting(self._plan, seed)
        place = self._met.station
        self._n = place.robot.nq
        self._senses = Senses(place, self._met.tracks, self._plan.sensor, seed)
        self._servo = Servo(place.start, self._plan.lag)
        self._q, self._command = place.start.copy(), np.zeros(self._n)
        self._k, self._time = 0, 0.0
        self._rows: list[tuple[Any, ...]] = []

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Array, dict[str, Any]]:
        """Begin an encounter: that of `seed`, else one drawn by the environment's own generator.

        Args:
            seed: As the campaign's, its trial `seed` of a plan whose first seed is 0.
            options: Not used.
        """
        super().reset(seed=seed)
        self._begin(int(self.np_random.integers(2**31)) if seed is None else seed)
        return self._observe(), {"seed": self._met.seed}

    def step(self, action: Array) -> tuple[Array, float, bool, bool, dict[str, Any]]:
        """Move for a tick of 4 ms."""
        wish = np.nan_to_num(np.asarray(action, dtype=float).reshape(self._n), nan=0.0, posinf=1.0, neginf=-1.0)
        robot = self._met.station.robot
        command = self._limits.box(self._q, self._command).clip(np.clip(wish, -1.0, 1.0) * robot.max_velocity)
        q, qd = self._servo.q, self._servo.qd
        self._q = self._q + command * DT
        self._command = command
        off = float(np.linalg.norm(self._error[:3]))
        working = off <= ON_PATH
        self._time += DT * working
        seen = self._senses.people_seen(q)
        phase = FOLLOWING if working else SUSPENDED
        self._rows.append((q, qd, self._q, command, phase, self._time, seen))
        self._servo.follow(self._q, command)
        self._k += 1
        place, tracks = self._met.station, self._met.tracks
        poses = place.robot.at(self._servo.q).body_poses()
        distance = place.distances.people(poses, tracks.row(min(self._k, len(tracks) - 1))).distance
        touched, over = distance <= 0.0, self._k >= len(tracks)
        reward = float(working) - HARM * max(1.0 - max(distance, 0.0) / CAREFUL, 0.0) - TOUCH * touched
        info: dict[str, Any] = {"distance": distance}
        if touched or over:
            info["measures"] = measures(self._plan, self._met, "policy", self._recording())
        return self._observe(), reward, bool(touched), bool(over and not touched), info

    def _observe(self) -> Array:
        k = min(self._k, len(self._met.tracks) - 1)
        q, qd, robot = self._servo.q, self._servo.qd, self._met.station.robot
        self._readings = self._senses.distances(q, k)
        sample = self._met.station.reference.sample(self._time)
        pose = robot.pose(robot.tool_frames[0], q)
        turn = log3(sample.pose[:3, :3] @ pose[:3, :3].T)
        self._error = np.concatenate((sample.pose[:3, 3] - pose[:3, 3], turn))
        readings = np.minimum(np.nan_to_num(self._readings, nan=0.0), self._range)
        return np.concatenate((
            (q - self._centre) / self._half, qd / robot.max_velocity, self._command / robot.max_velocity,
            readings, self._error, sample.twist,
        ))  # fmt: skip

    def _recording(self) -> Recording:
        q, qd, ref, ref_qd, phase, time, seen = zip(*self._rows, strict=True)
        return Recording(
            DT, np.array(q), np.array(qd), np.array(ref), np.array(ref_qd), np.array(phase), np.array(time),
            np.zeros(len(q), dtype=np.int64), list(seen),
        )  # fmt: skip


gymnasium.register(ID, entry_point=EncounterEnv)
