"""An encounter as an environment: a controller's commands as actions are its trial, and no action breaks a limit."""

import re
import runpy
import sys
import warnings
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pytest
from amounts import first
from gymnasium.utils.env_checker import check_env
from gymnasium.wrappers import RecordEpisodeStatistics
from numpy.testing import assert_allclose, assert_array_equal

from qpsafe.errors import ConfigurationError, MissingExtraError
from qpsafe.sim.campaign.gym import environment
from qpsafe.sim.campaign.gym.environment import ID, EncounterEnv, Observation
from qpsafe.sim.campaign.gym.policies import ControllerPolicy, episode
from qpsafe.sim.campaign.plan import Plan
from qpsafe.sim.campaign.trials.measures import measures
from qpsafe.sim.campaign.trials.meeting import meeting
from qpsafe.sim.campaign.trials.rows import columns_of
from qpsafe.sim.campaign.trials.trial import recorded

pytestmark = pytest.mark.long

HERE = Path(environment.__file__).resolve()


@pytest.fixture
def env(people: str) -> EncounterEnv:
    return EncounterEnv(motion="line", people=people)


def test_gymnasium_finds_no_fault_in_it(env: EncounterEnv) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        check_env(env, skip_render_check=True)


class Watched(ControllerPolicy):
    """Notes the joints it is told."""

    def __call__(self, observation: Observation) -> np.ndarray:
        self.joints = getattr(self, "joints", [])
        self.joints.append((observation["q"], observation["qd"]))
        return super().__call__(observation)


@pytest.mark.parametrize(
    ("name", "sensor", "lag"),
    [
        ("default", "ideal", 0.0),
        *(
            pytest.param(*case, marks=pytest.mark.slow)
            for case in (
                ("default", "sharp", 0.02),
                ("stop", "ideal", 0.0),
                ("none", "ideal", 0.02),
                ("barrier", "ideal", 0.0),
            )
        ),
    ],
)
def test_a_controllers_commands_as_actions_are_its_trial(people: str, name: str, sensor: str, lag: float) -> None:
    """To the last bit, where the trial is played tick by tick."""
    env = EncounterEnv(motion="line", people=people, sensor=sensor, lag=lag, stop_at_contact=False)
    policy = Watched.named(name, env.station)
    row = episode(env, policy, 7, name)
    plan = Plan(motions=("line",), people=people, sensor=sensor, lag=lag, controllers=(name,))
    met = meeting(plan, 7)
    run = recorded(plan, met, name, lambda *_: None)
    assert np.ptp(run.q, axis=0).max() > 0.05  # it moved
    joints = np.array(policy.joints)
    assert_array_equal(joints[:, 0], run.q)
    assert_array_equal(joints[:, 1], run.qd)
    expected = measures(plan, met, name, run)
    assert name == "none" or expected["first_sight"] < expected["simulated"]  # somebody is there to evade
    found, expected = columns_of([row]), columns_of([expected])
    for key, value in expected.items():
        assert_array_equal(found[key], value, key)
    assert_allclose(run.q, recorded(plan, met, name).q, rtol=0.0, atol=1e-9)  # compiled as a whole


def test_who_is_told_more_than_an_observation_says_is_no_policy(env: EncounterEnv) -> None:
    with pytest.raises(ConfigurationError, match="stop_perfect_sight"):
        ControllerPolicy.named("stop_perfect_sight", env.station)


def _wild(rng: np.random.Generator, n: int) -> np.ndarray:
    """Of any magnitude, some of it not finite."""
    action = rng.choice([-1.0, 1.0], n) * 10.0 ** rng.uniform(-3.0, 308.2, n)
    if rng.random() < 0.2:
        action[rng.integers(n)] = rng.choice([np.nan, np.inf, -np.inf])
    return action


@pytest.mark.parametrize("lag", first(1, [0.012, 0.0]))
def test_no_action_breaks_a_limit_and_all_are_reported(people: str, lag: float, rng: np.random.Generator) -> None:
    env = EncounterEnv(motion="line", people=people, lag=lag, stop_at_contact=False)
    robot, over, bad = env.station.robot, False, 0
    env.reset(seed=1)
    while not over:
        action = _wild(rng, robot.nq)
        observation, reward, _, over, info = env.step(action)
        assert env.observation_space.contains(observation)
        assert np.isfinite(reward)
        finite = np.isfinite(action).all()
        assert info["bad_action"] is not bool(finite)
        assert np.isfinite(info["outside_limits"])
        assert info["outside_limits"] > 0.0 or not finite or (np.abs(action) <= 1.0).all()
        bad += not finite
    row = info["measures"]
    assert row["limit_excess"] == 0.0
    assert row["bad_ticks"] == bad > 0


def test_after_an_action_that_is_no_number_it_brakes(env: EncounterEnv) -> None:
    env.reset(seed=1)
    for _ in range(20):
        before = env.step(np.ones(6))[0]["command"]
    assert (before > 0.0).all()
    for _ in range(200):
        command = env.step(np.array([0.5, np.nan, 0.5, 0.5, 0.5, 0.5]))[0]["command"]
        assert (np.abs(command) <= np.abs(before)).all()
        before = command
    assert_array_equal(command, 0.0)


def test_an_action_of_another_shape_is_refused(env: EncounterEnv) -> None:
    env.reset(seed=1)
    with pytest.raises(ConfigurationError, match="action"):
        env.step(np.zeros(7))


@pytest.mark.parametrize(
    "action",
    [
        np.zeros(6, dtype=complex), np.ma.masked_all(6), ["0"] * 6, "000000", np.zeros(6, bool),
        [0.0, [1.0], 0.0, 0.0, 0.0, 0.0], None, object(), np.zeros(6, dtype=object), np.zeros((6, 1)), 0.0, {},
    ],
)  # fmt: skip
def test_what_is_no_action_is_refused_and_changes_nothing(env: EncounterEnv, action: Any) -> None:
    first, _ = env.reset(seed=1)
    with pytest.raises(ConfigurationError, match="action"):
        env.step(action)
    once, *_ = env.step(np.zeros(6))
    env.reset(seed=1)
    for key, value in env.step([0] * 6)[0].items():
        assert_array_equal(once[key], value)
    assert first.keys() == once.keys()


@pytest.mark.parametrize("stop", [True, False])
def test_no_step_before_an_encounter_or_after_its_end(people: str, stop: bool, rng: np.random.Generator) -> None:
    env = EncounterEnv(motion="line", people=people, stop_at_contact=stop)
    with pytest.raises(ConfigurationError, match=r"reset\(\) first"):
        env.step(np.zeros(6))
    for seed in (3, int(rng.integers(100))):
        env.reset(seed=seed)
        over = False
        while not over:
            *_, terminated, truncated, info = env.step(np.zeros(6))
            over = terminated or truncated
        for _ in range(3):
            with pytest.raises(ConfigurationError, match=r"reset\(\) first"):
                env.step(np.zeros(6))
        again = env.measures()
        assert (again["contact"], again["distance"]) == (info["measures"]["contact"], info["measures"]["distance"])


@pytest.mark.parametrize("stop", ["no", 0, None, np.bool_(False), "False"])
def test_whether_contact_stops_it_is_true_or_false(stop: Any) -> None:
    with pytest.raises(ConfigurationError, match="stop_at_contact"):
        EncounterEnv(stop_at_contact=stop)


def test_contact_ends_an_episode_with_its_row(env: EncounterEnv) -> None:
    wrapped = RecordEpisodeStatistics(env)
    _, info = wrapped.reset(seed=3)
    assert info["seed"] == 3
    total, over, ticks = 0.0, False, 0
    while not over:
        _, reward, over, truncated, info = wrapped.step(np.zeros(6))
        total, ticks = total + float(reward), ticks + 1
        assert not truncated
    assert info["episode"]["r"] == pytest.approx(total)
    assert info["episode"]["l"] == ticks
    row = info["measures"]
    assert row["contact"]
    assert row["contact_class"] == "rest"  # a policy that does not move
    assert row["distance"] == pytest.approx(info["distance"], abs=1e-9)
    assert row["contact_time"] == pytest.approx(0.004 * ticks)
    assert row["seed"] == 3


def test_seeds_decide_and_draws_are_none_of_a_campaigns(env: EncounterEnv) -> None:
    def played(seed: int | None) -> tuple[int, bytes]:
        observation, info = env.reset(seed=seed)
        return info["seed"], b"".join(np.ascontiguousarray(value).tobytes() for value in observation.values())

    first, then = played(11), [played(None) for _ in range(3)]
    assert (first, then) == (played(11), [played(None) for _ in range(3)])
    assert all(seed >= 2**24 for seed, _ in then)
    assert len({seed for seed, _ in then}) == 3


@pytest.mark.parametrize("mode", ["sync", pytest.param("async", marks=pytest.mark.slow)])
def test_it_is_vectorised(people: str, mode: Any) -> None:
    many = gymnasium.make_vec(ID, num_envs=2, vectorization_mode=mode, motion="line", people=people)
    one = EncounterEnv(motion="line", people=people)
    actions = np.linspace(-0.3, 0.3, 12).reshape(2, 6)
    try:
        observations, _ = many.reset(seed=[5, 6])
        for k in range(2):
            alone, _ = one.reset(seed=5 + k)
            for key, value in alone.items():
                assert_array_equal(observations[key][k], value)
        for _ in range(3):
            observations = many.step(actions)[0]
            alone = one.step(actions[1])[0]
        for key, value in alone.items():
            assert_array_equal(observations[key][1], value)
    finally:
        many.close()


def test_perfect_sight_is_no_sensor_of_it() -> None:
    with pytest.raises(ConfigurationError, match="sensor = 'perfect'"):
        EncounterEnv(sensor="perfect")


def test_a_policy_before_its_first_action_has_said_nothing(env: EncounterEnv) -> None:
    assert ControllerPolicy(env.station.controller(), env.station).tick is None
    env.reset(seed=1)
    with pytest.raises(ConfigurationError, match="no tick yet"):
        env.measures()


def test_without_gymnasium_the_extra_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "gymnasium", None)
    with pytest.raises(MissingExtraError, match=r"pip install 'qpsafe\[gym\]'"):
        runpy.run_path(str(HERE))


def test_nothing_else_needs_gymnasium() -> None:
    root = HERE.parents[3]
    files = {path for name in ("qpsafe", "tasks", "robots", "sim") for path in (root / name).rglob("*.py")}
    needed = re.compile(r"^\s*(import|from) (gymnasium|qpsafe\.sim\.campaign\.gym)\b", re.MULTILINE)
    assert {path for path in files if needed.search(path.read_text(encoding="utf-8"))} <= {*HERE.parent.iterdir()}
