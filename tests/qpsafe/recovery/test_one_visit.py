"""One visit, one suspension: what is suspended stays so until danger has been small for a while, and is held."""

import numpy as np
import pytest
from amounts import some
from hypothesis import given, settings
from hypothesis import strategies as st

from qpsafe.errors import ConfigurationError
from qpsafe.recovery.recovery import FOLLOWING, RECOVERING, SUSPENDED, Recovery, RecoveryRules
from qpsafe.tasks.orientation import OrientationTask
from qpsafe.tasks.position import PositionTask
from qpsafe.tasks.trajectory import FixedPose, Sample

DT, ABOVE = 0.01, 9.775
RULES = RecoveryRules()


class State:
    """A robot's state, as far as tasks look at it."""

    def __init__(self, x: float = 0.0) -> None:
        self.q, self._pose = np.zeros(6), np.eye(4)
        self._pose[0, 3] = x

    def pose(self, frame: str) -> np.ndarray:
        return self._pose


def recovery(rules: RecoveryRules = RULES) -> Recovery:
    goal = FixedPose(np.eye(4))
    return Recovery((PositionTask("tcp", goal), OrientationTask("tcp", goal)), ABOVE, DT, rules)


def update(path: Recovery, danger: float, x: float = 0.0) -> tuple[Sample, ...]:
    active = float(danger <= ABOVE)
    return path.update(danger, State(x), (active, active))  # type: ignore[arg-type]


@given(
    dangers=st.lists(st.tuples(st.floats(0.0, 12.0) | st.just(np.nan), st.integers(1, 40)), max_size=20),
    calm=st.floats(0.1, 1.0),
    dwell=st.floats(0.0, 0.5),
)
@settings(deadline=None, max_examples=some(16, of=100))
def test_between_two_suspensions_danger_was_small_for_the_dwell(dangers: list, calm: float, dwell: float) -> None:
    """Whatever danger does: a suspension ends only after it was at or below calm Δ(1-ε) for longer than the dwell."""
    path, quiet, before = recovery(RecoveryRules(calm=calm, dwell=dwell)), 0.0, FOLLOWING
    for danger, ticks in dangers:
        for _ in range(ticks):
            update(path, danger)
            quiet = quiet + DT if danger <= calm * ABOVE else 0.0
            if not danger <= ABOVE:
                assert path.phase == SUSPENDED
            elif before == SUSPENDED:
                assert (path.phase == SUSPENDED) == (quiet <= dwell)
            before = path.phase


def test_danger_that_comes_and_goes_about_the_threshold_suspends_once() -> None:
    path, paper, begun = recovery(), recovery(RecoveryRules.paper()), [0, 0]
    for k in range(2000):
        for i, one in enumerate((path, paper)):
            before = one.phase
            update(one, ABOVE + 1.0 * np.sin(0.05 * k))
            begun[i] += before != SUSPENDED and one.phase == SUSPENDED
    assert begun == [1, 16]


def test_what_is_suspended_is_held_where_it_is_and_its_motion_runs_out() -> None:
    path, x, v = recovery(), 0.0, 1.0
    update(path, 20.0, x)
    for _ in range(20):  # evasion leads away
        x += v * DT
        held = update(path, 20.0, x)[0]
        assert path.phase == SUSPENDED
        assert held.pose[0, 3] == pytest.approx(x)  # no error: nothing pulls it back to the path
    assert held.twist[0] == pytest.approx(path.kept * v)
    for _ in range(round(RULES.dwell / DT) - 1):  # danger is small; nobody pulls either
        held = update(path, 0.0, x)[0]
        assert path.phase == SUSPENDED
        assert held.pose[0, 3] == pytest.approx(x)
    for _ in range(2):
        update(path, 0.0, x)
    assert path.phase == RECOVERING
    for _ in range(1000):
        x = update(path, 0.0, x)[0].pose[0, 3]
    assert (path.phase, x) == (FOLLOWING, 0.0)


def test_in_the_paper_what_is_left_of_a_task_pulls_it_back() -> None:
    path = recovery(RecoveryRules.paper())
    update(path, 20.0)
    assert update(path, 20.0, 0.3)[0].pose[0, 3] == 0.0
    update(path, ABOVE, 0.3)
    assert path.phase == RECOVERING


def test_a_tick_that_failed_is_none_for_the_dwell() -> None:
    path = recovery()
    update(path, 20.0)
    clocks = path.clocks
    for _ in range(2 * round(RULES.dwell / DT)):
        path.clocks = clocks
        update(path, 0.0)
    assert path.phase == SUSPENDED


@pytest.mark.parametrize(("key", "value"), [("calm", 1.1), ("dwell", -0.1), ("dwell", np.nan), ("held", 1)])
def test_rules_that_cannot_be_are_refused_by_name(key: str, value: float) -> None:
    with pytest.raises(ConfigurationError, match=key):
        RecoveryRules(**{key: value})  # type: ignore[arg-type]
