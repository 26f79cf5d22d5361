"""Makers under one name are told apart by what they do and what they hold, and are the same in every process."""

from __future__ import annotations

import itertools
import os
import subprocess
import sys
import threading
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import made_up_trials
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from qpsafe.errors import ConfigurationError
from qpsafe.gate.rules import VerifiedMotion
from qpsafe.sim.campaign.opponents import registry
from qpsafe.sim.campaign.opponents.fingerprint import fingerprint
from qpsafe.sim.campaign.opponents.registry import register
from qpsafe.sim.campaign.plan import Plan
from qpsafe.sim.campaign.runner import run_campaign

#: Each makes another controller.
SOURCES = (
    "def make(station): return station.controller()",
    "def make(station): return station.controller(gate='off')",
    "def make(station, gate='off'): return station.controller(gate=gate)",
    "def make(station, gate='on'): return station.controller(gate=gate)",
    "def make(station, *, gain=1.0): return gain",
    "def make(station, *, gain=2.0): return gain",
    "make = lambda station: 1.0",
    "make = lambda station: 2.0",
    "GAIN = 1.0\ndef make(station): return GAIN",
    "GAIN = 2.0\ndef make(station): return GAIN",
    "GAINS = {'a': [1.0, (2, None)]}\ndef make(station): return GAINS",
    "GAINS = {'a': [1.0, (3, None)]}\ndef make(station): return GAINS",
    "def helper(): return 1\ndef make(station): return helper()",
    "def helper(): return 2\ndef make(station): return helper()",
    "def outer(k):\n    def make(station): return k\n    return make\nmake = outer(1)",
    "def outer(k):\n    def make(station): return k\n    return make\nmake = outer(2)",
    "class Mine:\n    def step(self): return 1\ndef make(station): return Mine()",
    "class Mine:\n    def step(self): return 2\ndef make(station): return Mine()",
    "class make:\n    gain = 1\n    def __init__(self, station): ...",
    "class make:\n    gain = 2\n    def __init__(self, station): ...",
    "from functools import partial\ndef f(station, k): return k\nmake = partial(f, k=1)",
    "from functools import partial\ndef f(station, k): return k\nmake = partial(f, k=2)",
    "import numpy as np\nA = np.arange(5000.0)\ndef make(station): return A",
    "import numpy as np\nA = np.arange(5000.0)\nA[2500] = 7\ndef make(station): return A",
    "class Rule:\n    k = 0\n    def make(self, station): return self.k\nrule = Rule()\nrule.k = 1\nmake = rule.make",
    "class Rule:\n    k = 0\n    def make(self, station): return self.k\nrule = Rule()\nrule.k = 2\nmake = rule.make",
    "WORDS = {'a', 'b', 'c'}\ndef make(station): return WORDS, station in {'d', 'e', 'f'}",
    "WORDS = {'a', 'b', 'x'}\ndef make(station): return WORDS, station in {'d', 'e', 'f'}",
    "def make(station):\n    def deeper(): return make\n    return deeper",
)


def made(source: str) -> Callable[..., Any]:
    space: dict[str, Any] = {"__name__": "not_imported"}
    exec(compile(source, "x.py", "exec", dont_inherit=True), space)
    return space["make"]  # type: ignore[no-any-return]


def test_other_makers_have_other_digests_and_the_same_one_the_same() -> None:
    found = [fingerprint("mine", made(source)) for source in SOURCES]
    assert len(set(found)) == len(SOURCES)
    assert found == [fingerprint("mine", made("\n" + source)) for source in SOURCES]  # wherever it stands


@pytest.mark.slow
def test_they_are_the_same_in_another_process() -> None:
    """Whatever the seed of its hashes is."""
    script = (
        "import sys; sys.path[:0] = sys.argv[1:]\n"
        "from test_fingerprint import SOURCES, fingerprint, made\n"
        "print(*(fingerprint('mine', made(source)) for source in SOURCES))"
    )
    folders = [str(Path(__file__).parent), str(Path(made_up_trials.__file__).parent)]
    said = {
        subprocess.run(
            [sys.executable, "-c", script, *folders], env=os.environ | {"PYTHONHASHSEED": seed}, check=True,
            capture_output=True, text=True,
        ).stdout
        for seed in ("1", "2")
    }  # fmt: skip
    assert [*map(str.split, said)] == [[fingerprint("mine", made(source)) for source in SOURCES]]


plain = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats(allow_nan=False) | st.text(max_size=3),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=2), inner, max_size=3),
    max_leaves=6,
)


def holding(value: Any) -> Callable[..., Any]:
    return lambda station: value


@given(plain, plain)
def test_values_that_are_held_count(one: Any, other: Any) -> None:
    same = repr(one) == repr(other)
    assert (fingerprint("mine", holding(one)) == fingerprint("mine", holding(other))) == same


def test_objects_are_told_apart_by_what_they_are_made_of() -> None:
    things = [VerifiedMotion(escape=0.1), VerifiedMotion(escape=0.2), np.float64(3.0), np.float32(3.0), Path("a"), len]
    found = [fingerprint("mine", partial(holding, thing)) for thing in things]
    assert all(a != b for a, b in itertools.combinations(found, 2))
    assert found[0] == fingerprint("mine", partial(holding, VerifiedMotion(escape=0.1)))


@pytest.mark.parametrize(
    "thing",
    [threading.Lock(), (k for k in ()), sys.stdout, os.scandir],
    ids=["a lock", "a generator", "a stream", "built in"],
)
def test_what_nothing_tells_apart_is_refused_by_name(thing: Any) -> None:
    if thing is os.scandir:
        assert fingerprint("mine", holding(thing)) != fingerprint("mine", holding(os.listdir))
        return
    with pytest.raises(ConfigurationError, match=r"'mine': .*no later process can tell"):
        fingerprint("mine", holding(thing))


def test_trials_of_two_makers_of_one_name_do_not_mix(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    plans = []
    for source in (*SOURCES[6:8], SOURCES[6]):
        monkeypatch.setattr(registry, "_known", {k: v for k, v in registry._known.items() if k != "mine"})
        register("mine", made(source))
        plan = Plan(trials=4, controllers=("none", "mine_perfect_sight"))
        plans.append(plan.digest())
        if len(plans) == 2:
            with pytest.raises(ConfigurationError, match=r"registered = .*do not mix"):
                run_campaign(plan, tmp_path / "kept", trial=made_up_trials.run)
        else:
            run_campaign(plan, tmp_path / "kept", trial=made_up_trials.run)
    assert plans[0] == plans[2] != plans[1]
    register("held", holding(threading.Lock()))
    held = Plan(trials=2, controllers=("held",))
    run_campaign(held, trial=made_up_trials.run)  # nothing is kept, nothing can mix
    with pytest.raises(ConfigurationError, match=r"controllers = 'held': .*a lock"):
        run_campaign(held, tmp_path / "no", trial=made_up_trials.run)
    assert not (tmp_path / "no").exists()
    assert "registered" not in Plan().identity()
