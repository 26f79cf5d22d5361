"""The search for the worst case of a controller of a plan, and its cases as files that can be played again."""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Sequence
from concurrent.futures import Executor
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from qpsafe.errors import ConfigurationError
from qpsafe.sim.campaign.executors import answers, crew_at_work
from qpsafe.sim.campaign.plan import MOTIONS, Plan
from qpsafe.sim.campaign.worst.search import Found, search_worst


class Encounter(NamedTuple):
    """An encounter that is not drawn from a seed.

    Attributes:
        motion: What the robot does.
        u: Point of the unit cube of the people's model, (d,).
    """

    motion: str
    u: tuple[float, ...]


#: Plays an encounter: plan, encounter, controller -> its row. Deterministic, and possible to pickle.
CaseFunction = Callable[[Plan, Encounter, str], dict[str, Any]]


def find_worst(
    plan: Plan,
    controller: str,
    budget: int,
    executor: Executor | None = None,
    progress: Callable[[int, int], None] | None = None,
    *,
    workers: int = 1,
    case: CaseFunction | None = None,
    continuous: NDArray[np.bool_] | None = None,
) -> Found:
    """Search among all that the plan's people and motions allow.

    Args:
        plan: The campaign's; its seed is the search's, too.
        controller: Whose worst case.
        budget: Trials for the search, and as many again for the comparison.
        executor: Any of `concurrent.futures`, or Dask's; None for processes of our own.
        progress: Called with the trials that are done, and how many there are.
        workers: Processes, if there is no executor; 1 for none but this one.
        case: Plays an encounter; by default `qpsafe.sim.campaign.trials.trial.run_case`.
        continuous: Coordinates of the people's model in which an encounter is continuous, (d,); by default the model's.

    Raises:
        MissingExtraError: cma is not installed.
        ConfigurationError: The budget is too small.
        WorkerDiedError: A process died twice of the same encounter.
    """
    free = _continuous(plan) if continuous is None else continuous
    play = partial(_play, case or _engine(), plan, controller)
    with crew_at_work(executor, workers) as crew:

        def evaluate(points: NDArray[np.float64]) -> list[dict[str, Any]]:
            pieces = [(k, encounter_of(plan, u)) for k, u in enumerate(points.tolist())]
            return [row for _, row in sorted(answers(crew, play, pieces), key=lambda found: found[0])]

        # the first coordinate chooses the motion
        return search_worst(evaluate, 1 + len(free), budget, plan.seed, np.append([False], free), progress)


def encounter_of(plan: Plan, u: Sequence[float]) -> Encounter:
    """What a point of the search's cube stands for: its first coordinate chooses the motion."""
    return Encounter(plan.motions[min(int(u[0] * len(plan.motions)), len(plan.motions) - 1)], tuple(u[1:]))


def cases_to_dict(plan: Plan, controller: str, found: Found) -> dict[str, Any]:
    """A search for JSON, its cases as encounters.

    Args:
        plan: Of the search.
        controller: Whose worst case.
        found: What it found.
    """

    def case(said: dict[str, Any]) -> dict[str, Any]:
        return {**encounter_of(plan, said["u"])._asdict(), "row": said["row"]}

    table = found.to_dict()
    table |= {key: case(table[key]) for key in ("worst", "worst_random")}
    return {"controller": controller, "plan": plan.to_dict()} | table | {"cases": [case(c) for c in table["cases"]]}


class Case(NamedTuple):
    """A case of a file that `cases_to_dict` made.

    Attributes:
        plan: Of the search.
        controller: Whose worst case.
        encounter: The case.
    """

    plan: Plan
    controller: str
    encounter: Encounter


def load_case(path: Path, number: int) -> Case:
    """Read a case.

    Args:
        path: The JSON file.
        number: From 0.

    Raises:
        ConfigurationError: There is no such file or case, or its plan names what is not there.
    """
    try:
        table = json.loads(path.read_text(encoding="utf-8"))
        case, said = table["cases"][number], table["plan"]
        plan = said | {key: tuple(said[key]) for key in ("motions", "controllers")}
        encounter = Encounter(str(case["motion"]), tuple(float(x) for x in case["u"]))
        return Case(Plan(**plan), str(table["controller"]), encounter)
    except ConfigurationError as wrong:
        raise ConfigurationError(path, f"plan.{wrong.key}", wrong.value, wrong.expected) from None
    except (OSError, ValueError, KeyError, IndexError, TypeError) as error:
        problem = f"{type(error).__name__}: {error}"
        raise ConfigurationError(path, f"cases[{number}]", problem, "a case that a search has found") from None


def check_case(where: str, plan: Plan, case: Encounter) -> None:
    """Refuse a case that is none of a plan's: of other people, or of a motion that is not there.

    Args:
        where: The case, for errors.
        plan: Among whose people it is to be played.
        case: The case.

    Raises:
        ConfigurationError: Names what is wrong in it.
    """
    wanted = len(_continuous(plan))
    if len(case.u) != wanted:
        raise ConfigurationError(
            where, "u", f"{len(case.u)} numbers", f"{wanted} numbers from 0 to 1, for these people"
        )
    for k, value in enumerate(case.u):
        if not 0.0 <= value <= 1.0:
            raise ConfigurationError(where, f"u[{k}]", value, "a number from 0 to 1")
    if case.motion not in MOTIONS and not os.path.isfile(case.motion):
        raise ConfigurationError(where, "motion", case.motion, f"{', '.join(MOTIONS)}, or a program's file")


def _play(case: CaseFunction, plan: Plan, controller: str, piece: tuple[int, Encounter]) -> tuple[int, dict[str, Any]]:
    return piece[0], case(plan, piece[1], controller)


def _continuous(plan: Plan) -> NDArray[np.bool_]:
    from qpsafe.sim.campaign.people import EncounterModel  # type: ignore[import-not-found,unused-ignore]

    return np.asarray(EncounterModel.load(plan.people).continuous, dtype=bool)


def _engine() -> CaseFunction:
    from qpsafe.sim.campaign.trials.trial import run_case  # type: ignore[import-not-found,unused-ignore]

    return run_case
