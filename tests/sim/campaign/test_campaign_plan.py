"""Plans: what a file says is what is done, what is wrong in it is named, and a digest tells plans apart."""

from __future__ import annotations

import dataclasses
import pickle
import shlex
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from qpsafe.errors import ConfigurationError
from qpsafe.sim.campaign.plan import MOTIONS, Plan, PlanFile, code_digest, load_plan, parse_plan
from qpsafe.sim.campaign.trials.servo import DT
from qpsafe.text.toml_text import TomlText


def test_a_file_that_says_nothing_is_the_default_plan() -> None:
    assert parse_plan(TomlText("", "plan.toml")) == Plan()
    assert set(PlanFile.model_fields) == {field.name for field in dataclasses.fields(Plan)}


def test_a_file_says_a_plan_and_its_paths_are_relative_to_it(tmp_path: Path) -> None:
    (tmp_path / "people.toml").write_text("")
    (tmp_path / "work.toml").write_text("")
    file = tmp_path / "plan.toml"
    file.write_text(
        'robot = "iiwa14"\nmotions = ["hold", "work.toml"]\ncontrollers = ["stop", "default"]\nsensor = "sharp"\n'
        'lag = 0.02\npeople = "people.toml"\ntrials = 12\nseed = 7\n'
    )
    plan = load_plan(file)
    motions, people = ("hold", str(tmp_path / "work.toml")), str(tmp_path / "people.toml")
    assert plan == Plan("iiwa14", motions, ("stop", "default"), "sharp", 0.02, people, 12, 7)
    assert [plan.seed_of(k) for k in range(3)] == [7, 8, 9]
    assert pickle.loads(pickle.dumps(plan)) == plan
    before = plan.digest()
    (tmp_path / "people.toml").write_text("# changed")
    assert plan.digest() != before


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("trials = 0", "trials = 0: expected a whole number"),
        ("trials = 2.0", "trials = 2.0"),
        ("seed = -1", "seed = -1"),
        ("seed = true", "seed = True"),
        ("lag = 0.2", "lag = 0.2: expected 0 to 0.1 s"),
        ("lag = nan", "lag = nan"),
        ("lag = 0.001", "lag = 0.001: expected a multiple of the tick, 0.004 s"),
        ('sensor = "radar"', "sensor = 'radar'"),
        ('motions = ["dance"]', "motions = 'dance'"),
        ('motions = ["none.toml"]', "motions = 'none.toml'"),
        ("motions = []", "motions = "),
        ('controllers = ["stop", "stop"]', "twice"),
        ('controllers = ["brave"]', "controllers = 'brave': expected one of none, stop"),
        ('people = "nobody.toml"', "people = 'nobody.toml'"),
        ("speed = 3", "speed = 3"),
        ("robot = 140", "robot = 140"),
        ("trials =", "TOML"),
    ],
)
def test_what_is_wrong_in_a_file_is_named_with_its_line(text: str, said: str) -> None:
    with pytest.raises(ConfigurationError) as refused:
        parse_plan(TomlText("# a plan\n" + text, "plan.toml"))
    assert said in str(refused.value)
    assert str(refused.value).startswith("plan.toml:2: ")


@given(st.floats(0.0, 0.1))
def test_a_lag_is_played_as_it_was_asked_or_refused(lag: float) -> None:
    ticks = round(lag / DT)
    assert Plan(lag=ticks * DT).lag == ticks * DT
    if abs(lag - ticks * DT) > 1e-9:
        with pytest.raises(ConfigurationError, match="lag"):
            Plan(lag=lag)


@pytest.mark.parametrize("key", [field.name for field in dataclasses.fields(Plan)])
@pytest.mark.parametrize("value", [7.5, True, b"x", ["hold"], (["hold"],), (3,), {}, object()])
def test_a_value_of_another_kind_is_named(key: str, value: object) -> None:
    with pytest.raises(ConfigurationError) as refused:
        Plan(**{key: value})  # type: ignore[arg-type]
    assert refused.value.key == key


def test_a_digest_changes_with_all_that_decides_rows_and_with_nothing_else() -> None:
    plan = Plan()
    others = {
        "robot": "iiwa14",
        "motions": MOTIONS[:1],
        "controllers": ("stop",),
        "sensor": "sharp",
        "lag": 0.012,
        "people": __file__,
        "seed": 1,
        "cell": __file__,
    }
    digests = {dataclasses.replace(plan, **{key: value}).digest() for key, value in others.items()} | {plan.digest()}
    assert len(digests) == len(others) + 1
    assert set(others) | {"trials"} == {field.name for field in dataclasses.fields(Plan)}
    assert dataclasses.replace(plan, trials=3).digest() == plan.digest()


def test_the_code_is_part_of_the_digest(monkeypatch: pytest.MonkeyPatch) -> None:
    before = Plan().digest()
    assert len(code_digest()) == 64
    monkeypatch.setattr("qpsafe.sim.campaign.plan.code_digest", lambda: "other")
    assert Plan().digest() != before


@pytest.mark.parametrize(
    "plan",
    [Plan(), Plan(controllers=("stop", "none"), lag=0.012, seed=9), Plan(people=__file__, trials=4)],
)
def test_options_make_the_same_plan_again(plan: Plan) -> None:
    words = shlex.split(plan.options())
    said = dict(zip((word.removeprefix("--") for word in words[::2]), words[1::2], strict=True))
    kinds = {"lag": float, "trials": int, "seed": int, "controllers": lambda text: tuple(text.split(","))}
    assert Plan(**{key: kinds.get(key, str)(value) for key, value in said.items()}) == plan
    assert "--trials" not in plan.options(besides=("trials",))
