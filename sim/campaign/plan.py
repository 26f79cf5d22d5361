"""What a campaign is: which robot does what among whom, and who is compared. It can be read from a TOML file.

Everything that decides a trial's rows stands here, so a plan has a digest: rows of another plan, or of other code, are
never mixed with its own. How many trials there are is no part of it: a longer campaign goes on where a shorter one
ended.
"""

from __future__ import annotations

import hashlib
import os
import shlex
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, fields
from importlib.metadata import version
from importlib.util import find_spec
from pathlib import Path
from typing import Annotated, Any

from pydantic import BaseModel, ConfigDict, Field

from qpsafe.errors import ConfigurationError
from qpsafe.robot.loader import bundled_robots, find_robot
from qpsafe.sim.campaign.digests import robot_digest
from qpsafe.sim.campaign.trials.servo import DT
from qpsafe.sim.ranging.sets import sensor_kinds
from qpsafe.sim.recording.digest import code_digest, files_digest, files_in
from qpsafe.text.json_text import json_text
from qpsafe.text.toml_text import TomlText

#: Ending of the names of controllers that are told where everybody is.
PERFECT = "_perfect_sight"
MOTIONS = ("hold", "line", "pick")
#: Compared unless a plan says otherwise.
CONTROLLERS = (
    *("none", "stop", "stop_perfect_sight", "scaling", "nullspace", "weighted", "paper", "strict", "barrier"),
    *("velocities", "default"),
)
FULL, QUICK = 3_000, 12
LONGEST_LAG = 0.1  # [s]
MOST_TRIALS = 10_000_000


@dataclass(frozen=True)
class Plan:
    """A campaign, checked: what does not exist is refused.

    Attributes:
        robot: A bundled robot, or the path of a robot folder, MJCF or URDF file.
        motions: Some of `MOTIONS`, or paths of programs (TOML); trials take turns with them.
        controllers: Names of what is compared.
        sensor: By which all controllers see that do not say otherwise: `qpsafe.sim.ranging.sets.sensor_kinds`, e.g.
            ``ideal``, ``sharp``, ``vl53l5cx``, ``sharp+depth``.
        lag: Delay of the servos, in whole ticks, whose joints are of second order then [s]; 0: they follow perfectly.
        people: A TOML file with a model of people, a story, or a folder of stories; None for the bundled model.
        trials: How many.
        seed: Of the first trial; that of trial k is seed + k.
        cell: A TOML file of furniture, see `qpsafe.sensing.cell_file`, besides the robot's pedestal; None for none.
    """

    robot: str = "irb140"
    motions: tuple[str, ...] = MOTIONS
    controllers: tuple[str, ...] = CONTROLLERS
    sensor: str = "ideal"
    lag: float = 0.0
    people: str | None = None
    trials: int = FULL
    seed: int = 0
    cell: str | None = None

    def __post_init__(self) -> None:
        self._check_values()
        self._check_files()

    @classmethod
    def stored(cls, said: Mapping[str, Any]) -> Plan:
        """A plan as a file of JSON says it, every key: its values are checked, but not whether what it names is there.

        Raises:
            ConfigurationError: Names key and value of what is wrong.
        """
        if said.keys() != {field.name for field in fields(cls)}:
            raise ConfigurationError("Plan", "keys", ", ".join(said), ", ".join(field.name for field in fields(cls)))
        plan = object.__new__(cls)
        for key, value in said.items():
            object.__setattr__(plan, key, tuple(value) if isinstance(value, list) else value)
        plan._check_values()
        return plan

    def _check_values(self) -> None:
        sensor_kinds(self.sensor)
        if isinstance(self.lag, bool) or not isinstance(self.lag, int | float):
            raise ConfigurationError("Plan", "lag", self.lag, "a number [s]")
        if not 0.0 <= self.lag <= LONGEST_LAG:
            raise ConfigurationError("Plan", "lag", self.lag, f"0 to {LONGEST_LAG} s")
        if abs(self.lag - DT * round(self.lag / DT)) > 1e-9:  # a servo would round it
            raise ConfigurationError("Plan", "lag", self.lag, f"a multiple of the tick, {DT} s")
        for key, least, most in (("trials", 1, MOST_TRIALS), ("seed", 0, 2**53)):
            value = getattr(self, key)
            if isinstance(value, bool) or not isinstance(value, int) or not least <= value <= most:
                raise ConfigurationError("Plan", key, value, f"a whole number from {least} to {most}")
        for key in ("motions", "controllers"):
            names = getattr(self, key)
            words = isinstance(names, tuple) and names and all(isinstance(name, str) for name in names)
            if not words or len(set(names)) < len(names):
                raise ConfigurationError("Plan", key, names, "a tuple of at least one name, none of them twice")
        for key in ("robot", "people", "cell"):
            value = getattr(self, key)
            if not isinstance(value, str) and (value is not None or key == "robot"):
                raise ConfigurationError("Plan", key, value, "a name or a path, as text")

    def _check_files(self) -> None:
        # os.path, unlike Path, says False of what cannot be a name
        for motion in self.motions:
            if motion not in MOTIONS and not (motion.endswith(".toml") and os.path.isfile(motion)):
                expected = f"{', '.join(MOTIONS)}, or a program's file that is there"
                raise ConfigurationError("Plan", "motions", motion, expected)
        if self.people is not None and not os.path.exists(self.people):
            raise ConfigurationError(
                "Plan", "people", self.people, "a TOML file, or a folder of stories, that is there"
            )
        if self.cell is not None and not os.path.isfile(self.cell):
            raise ConfigurationError("Plan", "cell", self.cell, "a TOML file of furniture that is there")
        for name in self.controllers:
            _check_controller(name)

    def seed_of(self, trial: int) -> int:
        """Of everything random in a trial."""
        return self.seed + trial

    def to_dict(self) -> dict[str, Any]:
        """For JSON."""
        return asdict(self)

    def placed(self) -> dict[str, Any]:
        """For JSON that is read from whatever folder: paths of robot, people and cell are whole."""
        said = self.to_dict()
        here = {key: said[key] for key in ("robot", "people", "cell") if said[key] is not None}
        bundled = bundled_robots()
        return said | {key: os.path.abspath(v) for key, v in here.items() if v not in bundled and os.path.exists(v)}

    def named(self) -> dict[str, Any]:
        """What decides its rows, for JSON, but for contents of files: of these it has names, wherever they lie."""
        return names_only({key: value for key, value in self.to_dict().items() if key != "trials"})

    def identity(self) -> dict[str, Any]:
        """What decides a trial's rows: the plan but for its length, contents of its files, and the code's digest."""
        from qpsafe.sim.campaign.opponents.registry import maker_digest

        files = {"people": self.people, "cell": self.cell}
        files |= {motion: motion for motion in self.motions if motion not in MOTIONS}
        makers = {}
        for name in self.controllers:
            base = name.removesuffix(PERFECT)
            place = base.rpartition(":")[0]
            if place:  # a user's own
                module = None if place.endswith(".py") else find_spec(place)
                files[place] = place if module is None else str(module.origin)
            elif (maker := maker_digest(base)) is not None:
                makers[base] = maker
        there = {key: Path(path) for key, path in files.items() if path is not None and os.path.exists(path)}
        found = {key: files_digest(files_in(path)) for key, path in there.items()}
        if self.robot not in bundled_robots():  # whose files are part of the code
            found["robot"] = robot_digest(self.robot)
        versions = {name: version(name) for name in ("numpy", "numba", "pin", "mujoco")}
        said = self.named() | {"with": versions, "files": found, "code": code_digest()}
        return said | ({"registered": makers} if makers else {})

    def digest(self) -> str:
        """64 hexadecimal digits that stand for `identity`."""
        return identity_digest(self.identity())

    def options(self, besides: Sequence[str] = ()) -> str:
        """Options of the command line that make this plan: those that differ from the default one.

        Args:
            besides: Keys to leave out.
        """
        words: list[str] = []
        for field in fields(self):
            value = getattr(self, field.name)
            if value == field.default or field.name in besides:
                continue
            many = isinstance(value, tuple)
            words += [
                f"--{field.name}",
                ",".join(value) if many else f"{value!r}" if field.name == "lag" else str(value),
            ]
        return shlex.join(words)


def identity_digest(identity: Mapping[str, Any]) -> str:
    """64 hexadecimal digits that stand for a plan's identity, the same after JSON."""
    return hashlib.sha256(json_text(identity, indent=None, sort_keys=True).encode()).hexdigest()


def names_only(said: Mapping[str, Any]) -> dict[str, Any]:
    """What a plan says, of the paths of robot, people and cell the last names only."""
    paths = {key: said.get(key) for key in ("robot", "people", "cell")}
    names = {key: os.path.basename(os.path.normpath(path)) for key, path in paths.items() if isinstance(path, str)}
    return dict(said) | names


_Word = Annotated[str, Field(strict=True, min_length=1, max_length=200)]
_Whole = Annotated[int, Field(strict=True)]


class PlanFile(BaseModel):
    """What the file may say; values are checked by `Plan`."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    robot: _Word = Plan.robot
    motions: list[_Word] = list(Plan.motions)
    controllers: list[_Word] = list(Plan.controllers)
    sensor: _Word = Plan.sensor
    lag: Annotated[float, Field(strict=True)] = Plan.lag
    people: _Word | None = None
    cell: _Word | None = None
    trials: _Whole = Plan.trials
    seed: _Whole = Plan.seed


def load_plan(path: str | Path) -> Plan:
    """A plan from its file; paths in it are relative to the file.

    Raises:
        ConfigurationError: Names file, line, key and value of what is wrong.
    """
    return parse_plan(TomlText.read(Path(path)), Path(path).parent)


def parse_plan(text: TomlText, folder: Path = Path()) -> Plan:
    """A plan from its text; see `load_plan`."""
    said = text.checked(PlanFile)
    tables = said.model_dump() | {"motions": tuple(said.motions), "controllers": tuple(said.controllers)}
    tables["motions"] = tuple(str(folder / name) if name.endswith(".toml") else name for name in said.motions)
    for key in ("people", "cell"):
        if tables[key] is not None:
            tables[key] = str(folder / tables[key])
    if os.path.exists(folder / said.robot):
        tables["robot"] = str(folder / said.robot)
    try:
        find_robot(tables["robot"])
    except ConfigurationError as wrong:
        raise text.wrong(["robot"], said.robot, wrong.expected) from None
    try:
        return Plan(**tables)
    except ConfigurationError as wrong:
        raise text.wrong([wrong.key], wrong.value, wrong.expected) from None


def _check_controller(name: str) -> None:
    from qpsafe.sim.campaign.opponents import opponent

    try:
        opponent(name)
    except ConfigurationError as wrong:
        raise ConfigurationError("Plan", "controllers", name, wrong.expected) from None
