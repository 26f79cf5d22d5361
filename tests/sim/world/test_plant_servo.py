import mujoco
import numpy as np
import pytest

from qpsafe.errors import ConfigurationError
from qpsafe.robot.loader import load_robot
from qpsafe.sim.world.plant import Plant, SimulationFailedError
from qpsafe.sim.world.scene import build_scene

DT = 0.004


@pytest.fixture(scope="module")
def robot():
    return load_robot("irb140")


@pytest.fixture(scope="module")
def scene(robot):
    return build_scene(robot)


def sine(robot, rate=1.0, frequency=4.0):
    """A smooth reference whose joints all peak at a rate [rad/s]: position and velocity over time."""
    signs = np.array([1.0, -1.0, 1.0, -1.0, 1.0, -1.0])

    def at(t):
        share = min(t / 0.5, 1.0)  # a start at rest, without a jump of the acceleration
        angle, window = frequency * t, share**2 * (3 - 2 * share)
        slope = 0.0 if share == 1.0 else 6 * share * (1 - share) / 0.5
        swing = rate / frequency * np.sin(angle)
        return robot.home + signs * window * swing, signs * (window * rate * np.cos(angle) + slope * swing)

    return at


def follow(plant, reference, duration):
    """Measured positions at the ends of the control periods."""
    measured = []
    for k in range(round(duration / DT)):
        plant.apply(*reference(k * DT))
        plant.advance()
        measured.append(plant.q)
    return np.array(measured)


def test_it_holds_its_pose_against_gravity(robot, scene):
    rng = np.random.default_rng(0)
    plant = Plant(scene)
    for q in [robot.home, *rng.uniform(0.9 * robot.lower, 0.9 * robot.upper, (5, 6))]:
        plant.reset(q)
        plant.advance(1.0)
        assert np.abs(plant.q - q).max() < 1e-4
        assert np.abs(plant.qd).max() < 1e-4
        assert plant.saturated == 0


def test_it_follows_a_smooth_reference(robot, scene):
    reference = sine(robot)
    measured = follow(Plant(scene), reference, 3.0)
    wanted = np.array([reference((k + 1) * DT)[0] for k in range(len(measured))])
    assert np.ptp(measured, axis=0).min() > 0.4  # every joint did move
    assert np.abs(measured - wanted).max() < 2e-3


def test_a_step_settles_without_overshoot_and_within_the_torque_limits(robot, scene):
    plant = Plant(scene)
    goal = robot.home + 0.1
    low, high = plant.torque_limits.T
    errors = []
    for _ in range(150):
        plant.apply(goal, np.zeros(6))
        plant.advance()
        assert (plant.torque >= low).all()
        assert (plant.torque <= high).all()
        assert (np.abs(plant.data.ctrl[scene.actuators]) <= high).all()
        errors.append(np.abs(plant.q - goal).max())
    assert plant.saturated > 0  # 0.1 rad at once is more than the motors can do
    assert errors[-1] < 1e-5
    assert max(errors[75:]) < 1e-3


@pytest.mark.parametrize("lag", [0.010, 0.0163])
def test_lag_shifts_the_response_by_whole_physics_steps(robot, scene, lag):
    """With the same references, the lagging plant does the same thing later."""
    reference = sine(robot)
    prompt, late = Plant(scene), Plant(scene, lag=lag)
    shift = round(lag / scene.model.opt.timestep)
    assert late.lag == pytest.approx(shift * 0.001)
    histories = {0: [], 1: []}
    for k in range(1000):  # physics steps
        for i, plant in enumerate((prompt, late)):
            if k % 4 == 0:
                plant.apply(*reference(k * 0.001))
            plant.advance(0.001)
            histories[i].append(plant.q)
    a, b = np.array(histories[0]), np.array(histories[1])
    assert np.abs(a[:-shift] - b[shift:]).max() < 1e-12
    assert np.abs(a - b).max() > 1e-3


def test_runs_are_bit_identical(robot, scene):
    reference = sine(robot, rate=2.0)
    plant = Plant(scene, lag=0.012)
    first = follow(plant, reference, 1.0)
    plant.reset(robot.home)
    assert (follow(plant, reference, 1.0) == first).all()
    assert (follow(Plant(build_scene(robot), lag=0.012), reference, 1.0) == first).all()


def test_within_a_period_the_reference_moves_with_its_velocity_and_then_it_stops(robot, scene):
    plant = Plant(scene)
    rate = np.full(6, 0.5)
    plant.apply(robot.home, rate)
    seen = []
    for _ in range(8):
        plant.advance(0.001)
        seen.append(plant.reference)
    for k, (q, qd) in enumerate(seen, start=1):
        assert q == pytest.approx(robot.home + rate * 0.001 * min(k, 4), abs=1e-12)
        assert qd == pytest.approx(rate if k < 4 else 0.0, abs=0.0)


@pytest.mark.parametrize(
    ("q", "qd"),
    [
        (np.full(6, np.nan), np.zeros(6)),
        (np.zeros(6), np.full(6, np.inf)),
        (np.zeros(5), np.zeros(5)),
        (np.zeros((6, 1)), np.zeros(6)),
        ("home", "fast"),
        (None, None),
    ],
)
def test_what_is_no_reference_is_counted_and_never_applied(robot, scene, q, qd):
    plant, untouched = Plant(scene), Plant(scene)
    assert plant.apply(q, qd) is False
    assert plant.rejected == 1
    plant.advance()
    untouched.advance()
    assert (plant.q == untouched.q).all()
    assert plant.apply(robot.home, np.zeros(6)) is True


def test_a_reference_is_copied(robot, scene):
    plant, q = Plant(scene), robot.home.copy()
    plant.apply(q, np.zeros(6))
    q += 1.0
    plant.advance()
    assert plant.reference[0] == pytest.approx(robot.home)


def test_a_broken_state_ends_the_run_with_a_named_error(scene):
    plant = Plant(scene)
    plant.advance()
    plant.data.qvel[0] = np.nan
    with pytest.raises(SimulationFailedError, match="BADQ") as error:
        plant.advance()
    assert error.value.count >= 1
    assert error.value.time == pytest.approx(plant.time)


def test_geom_poses_belong_to_the_measured_position(robot, scene):
    plant, reference = Plant(scene), sine(robot)
    follow(plant, reference, 0.4)
    assert plant.data.site_xpos[scene.tcp_site] == pytest.approx(robot.pose("tcp", plant.q)[:3, 3], abs=1e-9)


def test_power_comes_from_the_motors_only(robot):
    """The energy the arm gains is what the torques put in, less what the joints' damping takes."""
    step = 0.00025
    plant, reference = Plant(build_scene(robot, timestep=step)), sine(robot)
    model, data = plant.scene.model, plant.data

    def energy():
        mujoco.mj_forward(model, data)
        mujoco.mj_energyPos(model, data)
        mujoco.mj_energyVel(model, data)
        return float(np.sum(data.energy))

    before, work = energy(), 0.0
    for k in range(2000):
        if k % 16 == 0:
            plant.apply(*reference(k * step))
        q, rate = plant.q, plant.qd
        plant.advance(step)
        work += float(plant.torque @ (plant.q - q)) - step * float(model.dof_damping @ (rate * plant.qd))
    gained = energy() - before
    assert abs(gained) > 1.0
    assert work == pytest.approx(gained, rel=0.015)


@pytest.mark.parametrize(
    ("change", "key"),
    [
        ({"lag": -0.01}, "lag"),
        ({"lag": np.nan}, "lag"),
        ({"period": 0.0035}, "period"),
        ({"period": 0.0}, "period"),
        ({"omega": 1000.0}, "omega"),
        ({"zeta": 0.0}, "zeta"),
        ({"q": np.full(6, np.nan)}, "q"),
    ],
)
def test_a_wrong_plant_names_what_is_wrong(scene, change, key):
    with pytest.raises(ConfigurationError) as error:
        Plant(scene, **change)
    assert error.value.key == key
