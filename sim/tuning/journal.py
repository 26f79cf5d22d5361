"""What a search has done so far, as lines of JSON: the first says what is searched, each other one holds a batch,
or some finalists of the finals.

A line is on the disk before the next batch begins; what a killed process left half written is cut off. A batch that is
not there is played again, and gives the same.
"""

from __future__ import annotations

import json
import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from pydantic import BaseModel, ConfigDict, ValidationError

from qpsafe.errors import ConfigurationError
from qpsafe.sim.tuning.objectives import Outcome, Played
from qpsafe.sim.tuning.trial import Trial, played_to_dict
from qpsafe.text.json_text import json_text

FORMAT = "qpsafe tuning 1"


class _First(BaseModel):
    """The first line."""

    model_config = ConfigDict(extra="ignore", strict=True)

    format: str
    identity: dict[str, Any]


class _Line(BaseModel):
    """Any other line."""

    model_config = ConfigDict(extra="forbid", strict=True, allow_inf_nan=False)

    seconds: float
    trials: list[Trial] = []
    finals: dict[int, tuple[int, list[Outcome]]] = {}
    reference: dict[int, list[Outcome]] | None = None


class Journal:
    """A file of finished batches.

    Args:
        path: The file; made with its folder if it is not there. None keeps all in memory.
        identity: What is searched, for JSON: a file of another search is refused.

    Raises:
        ConfigurationError: The file is of another search or of other code, or is none; names the line that is wrong.
    """

    def __init__(self, path: Path | None, identity: Mapping[str, Any]) -> None:
        self._path = path
        self.trials: list[Trial] = []
        #: Outcomes of the present values; None as long as they have not been played.
        self.reference: Played | None = None
        #: Outcomes in the finals, by number of the trial.
        self.finals: dict[int, list[Outcome]] = {}
        #: Processor time of all batches [s].
        self.seconds = 0.0
        said = json.loads(json_text({"format": FORMAT, "identity": identity}))
        if path is None:
            return
        if not path.exists():
            path.parent.mkdir(parents=True, exist_ok=True)
            self._write(said)
            return
        lines = _whole_lines(path)
        if lines:
            self._check(path, said, lines[0])
        else:
            self._write(said)
        for number, line in enumerate(lines[1:], start=2):
            try:
                self._take(_Line.model_validate_json(line))
            except ValueError as problem:
                raise _wrong(path, number, line, problem) from None

    @staticmethod
    def _check(path: Path, said: Mapping[str, Any], line: str) -> None:
        """Whether the first line says the same search."""
        try:
            there = _First.model_validate_json(line)
        except ValueError as problem:
            raise _wrong(path, 1, line, problem) from None
        if there.format != FORMAT:
            raise ConfigurationError(path, "format", there.format, f"{FORMAT!r}: the journal of a tuning")
        for key, value in said["identity"].items():
            if there.identity.get(key) != value:
                expected = f"{value!r}, as now: another search needs another folder"
                raise ConfigurationError(path, key, there.identity.get(key), expected)

    @property
    def folder(self) -> Path | None:
        """Where the file lies; None for none."""
        return None if self._path is None else self._path.parent

    @property
    def batches(self) -> int:
        """How many are finished, with that of the present values."""
        return 1 + max((trial.batch for trial in self.trials), default=-1)

    def keep(self, trials: Sequence[Trial], seconds: float, reference: Played | None = None) -> None:
        """Add a finished batch.

        Args:
            trials: Of it.
            seconds: That processes spent on it.
            reference: Outcomes of the present values, with their batch.
        """
        line = {"trials": [trial.to_dict() for trial in trials], "seconds": seconds}
        if reference is not None:
            line["reference"] = played_to_dict(reference)
        self._keep(line)

    def keep_finals(self, runs: Mapping[int, tuple[int, Sequence[Outcome]]], seconds: float) -> None:
        """Add outcomes of finals.

        Args:
            runs: By number of the trial: the first encounter's number, and outcomes from it on.
            seconds: That processes spent on it.
        """
        finals = {str(number): [first, [list(run) for run in mine]] for number, (first, mine) in runs.items()}
        self._keep({"finals": finals, "seconds": seconds})

    def _keep(self, line: Mapping[str, Any]) -> None:
        if self._path is not None:
            self._write(line)
        self._take(_Line.model_validate_json(json_text(line, indent=None)))

    def _take(self, line: _Line) -> None:
        """Add what a line says.

        Raises:
            ValueError: It does not go on from the lines before it.
        """
        if [trial.number for trial in line.trials] != [len(self.trials) + k for k in range(len(line.trials))]:
            raise ValueError(f"trials that go on from number {len(self.trials)}")
        for number, (first, _) in line.finals.items():
            if not 0 <= first <= len(self.finals.get(number, ())):
                raise ValueError(f"finals of trial {number} that go on from {len(self.finals.get(number, ()))}")
        if line.reference is not None and 0 not in line.reference:
            raise ValueError("outcomes of the present values without lag")
        self.trials += line.trials
        self.seconds += line.seconds
        for number, (first, runs) in line.finals.items():
            self.finals[number] = self.finals.get(number, [])[:first] + runs
        if line.reference is not None:
            self.reference = line.reference

    def _write(self, line: Mapping[str, Any]) -> None:
        assert self._path is not None
        with self._path.open("a", encoding="utf-8") as file:
            file.write(json_text(line, indent=None) + "\n")
            file.flush()
            os.fsync(file.fileno())


def _whole_lines(path: Path) -> list[str]:
    """The lines of a file; what comes after the last end of a line is cut off, in the file too."""
    try:
        data = path.read_bytes()
        end = data.rfind(b"\n") + 1
        if end < len(data):
            with path.open("r+b") as file:
                file.truncate(end)
        return data[:end].decode().splitlines()
    except (OSError, UnicodeDecodeError) as error:
        raise ConfigurationError(path, "file", str(error), "the journal of a tuning") from None


def _wrong(path: Path, number: int, line: str, problem: ValueError) -> ConfigurationError:
    """What is to be said of a line.

    Args:
        path: Of the file.
        number: Of the line, from 1.
        line: Its text.
        problem: Why it cannot be used.
    """
    why = str(problem)
    if isinstance(problem, ValidationError):
        first = problem.errors(include_url=False)[0]
        where = ".".join(map(str, first["loc"])) or "all of it"
        why = f"a line of JSON as a tuning writes them ({where}: {first['msg']})"
    return ConfigurationError(path, f"line {number}", line[:60], why)
