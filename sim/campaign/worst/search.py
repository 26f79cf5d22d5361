"""The worst that can happen under a controller: a search among all encounters that the model of people allows.

An encounter is a point of the unit cube. A quarter of the budget is random; from the worst of that, CMA-ES climbs in
the coordinates in which an encounter is continuous, those that choose between things kept, one start after the other.
As many random trials are played beside it, to see how much the search gains.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from qpsafe.errors import ConfigurationError
from qpsafe.sim.campaign.worst.strategy import strategy

Array = NDArray[np.float64]

NEAR = 0.05  # smallest distance below which a case is kept [m]
WANTED = 10  # cases that a search should find
RUNS = 4  # starts that a budget lasts for at least
STEP = 0.15  # first standard deviation of a climb, of the cube's edge
LEAST = 40  # trials
_BATCH = 64

#: Plays encounters: points (k, d) -> their rows.
Evaluate = Callable[[Array], Sequence[dict[str, Any]]]


class Case(NamedTuple):
    """An encounter that was played.

    Attributes:
        u: Its point of the unit cube, (d,).
        row: What came of it.
        climb: Number of the climb that found it; -1 for a random one.
    """

    u: tuple[float, ...]
    row: dict[str, Any]
    climb: int = -1

    @property
    def near(self) -> bool:
        """Whether it is kept: contact, or less than `NEAR`."""
        return bool(self.row["contact"] or self.row["distance"] < NEAR)

    @property
    def kind(self) -> tuple[Any, ...]:
        """What happens in it: motion, touched part and touching body, what the robot did, and when, to 0.5 s."""
        words = tuple(self.row.get(key) for key in ("motion", "contact_region", "contact_frame", "contact_class"))
        return (*words, int(self.row.get("distance_time", 0.0) / 0.5))

    @property
    def harm(self) -> float:
        """What the search maximises; anything that is not a number counts as no harm."""
        value = float(self.row["search"])
        return value if np.isfinite(value) else -np.inf


@dataclass(frozen=True)
class Found:
    """What a search found, and random trials of the same number.

    Attributes:
        budget: Trials of either.
        searched: Cases of the search that are near, the worst first.
        random: Those of the random trials.
        worst: The worst of the search, near or not.
        worst_random: The worst of the random trials.
        new: Of `searched`: what climbs found and random trials did not, see `_new`.
    """

    budget: int
    searched: tuple[Case, ...]
    random: tuple[Case, ...]
    worst: Case
    worst_random: Case
    new: tuple[Case, ...]

    @property
    def sentence(self) -> str:
        """A summary in words."""
        touched, near = (sum(bool(case.row["contact"]) for case in cases) for cases in (self.searched, self.random))
        text = (
            f"{self.budget:,} searched trials: {len(self.searched):,} nearer than {1e3 * NEAR:.0f} mm, {touched:,} of "
            f"them contacts; {self.budget:,} random ones: {len(self.random):,} and {near:,}. Worst harm of the "
            f"searched {self.worst.harm:.2f}, of the random ones {self.worst_random.harm:.2f}. {len(self.new):,} of "
            "the searched are new: of a kind that no random trial was, or worse than all of its kind."
        )
        if len(self.new) < WANTED:
            text += f" The search could not find {WANTED}."
        return text

    def to_dict(self) -> dict[str, Any]:
        """For JSON; `cases` are those of `new`, then the rest of `searched`."""
        rest = [case for case in self.searched if case not in self.new]
        return {
            "budget": self.budget,
            "sentence": self.sentence,
            "new": len(self.new),
            "searched": len(self.searched),
            "random": len(self.random),
            "worst": self.worst._asdict(),
            "worst_random": self.worst_random._asdict(),
            "cases": [case._asdict() for case in (*self.new, *rest)],
        }


def search_worst(
    evaluate: Evaluate,
    dimensions: int,
    budget: int,
    seed: int = 0,
    continuous: NDArray[np.bool_] | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> Found:
    """Search, and compare with random trials.

    Args:
        evaluate: Plays encounters, many at a time.
        dimensions: d, of the cube.
        budget: Trials for the search, and as many again for the comparison.
        seed: Of everything random.
        continuous: Coordinates to climb in, (d,); all by default.
        progress: Called with the trials that are done, and how many there are.

    Raises:
        MissingExtraError: cma is not installed.
        ConfigurationError: The budget is too small.
    """
    if budget < LEAST:
        raise ConfigurationError("search_worst", "budget", budget, f"at least {LEAST} trials")
    free = np.ones(dimensions, dtype=bool) if continuous is None else np.asarray(continuous, dtype=bool)
    done = 0

    def play(points: Array) -> list[Case]:
        nonlocal done
        found = [Case(tuple(u.tolist()), dict(row)) for u, row in zip(points, evaluate(points), strict=True)]
        done += len(found)
        if progress is not None:
            progress(done, 2 * budget)
        return found

    searched = list(_searched(play, np.random.default_rng((seed, 0)), dimensions, budget, free))
    beside = _at_random(play, np.random.default_rng((seed, 1)), dimensions, budget)
    near, near_random = (_by_harm(case for case in cases if case.near) for cases in (searched, beside))
    return Found(
        budget,
        near,
        near_random,
        _by_harm(searched)[0],
        _by_harm(beside)[0],
        tuple(_new(near, near_random)),
    )


def _at_random(play: Callable[[Array], list[Case]], rng: np.random.Generator, d: int, count: int) -> list[Case]:
    points = rng.random((count, d))
    return [case for first in range(0, count, _BATCH) for case in play(points[first : first + _BATCH])]


def _searched(
    play: Callable[[Array], list[Case]], rng: np.random.Generator, d: int, budget: int, free: NDArray[np.bool_]
) -> Iterator[Case]:
    """Random cases, then climbs from the worst of them, until the budget is spent."""
    explored = _at_random(play, rng, d, budget // 4)
    yield from explored
    left = budget - len(explored)
    most = max(left // RUNS, 1)
    for number, start in enumerate(_by_harm(explored)):
        for case in _climb(play, rng, np.array(start.u), free, min(most, left)):
            left -= 1
            yield case._replace(climb=number)
        if left <= 0:
            return


def _climb(
    play: Callable[[Array], list[Case]], rng: np.random.Generator, start: Array, free: NDArray[np.bool_], budget: int
) -> Iterator[Case]:
    """CMA-ES from a case, until it stands still or its budget is spent."""
    if free.sum() < 2:  # nothing that CMA-ES could adapt to
        points = np.tile(start, (budget, 1))
        points[:, free] = rng.random((budget, int(free.sum())))
        yield from play(points)
        return
    climb = strategy(
        np.clip(start[free], 1e-6, 1.0 - 1e-6), STEP, rng, bounds=[0.0, 1.0], tolfun=1e-6, tolx=1e-4
    )  # fmt: skip
    while budget > 0 and not climb.stop():
        asked = np.array(climb.ask())
        points = np.tile(start, (len(asked), 1))
        points[:, free] = np.clip(asked, 0.0, 1.0)
        if len(points) > budget:  # the last few cannot be told to it
            yield from play(points[:budget])
            return
        cases = play(points)
        climb.tell(asked, [min(-case.harm, 1e9) for case in cases])
        budget -= len(cases)
        yield from cases


def _by_harm(cases: Iterator[Case] | Sequence[Case]) -> tuple[Case, ...]:
    return tuple(sorted(cases, key=lambda case: -case.harm))


def _new(near: Sequence[Case], others: Sequence[Case]) -> Iterator[Case]:
    """What climbs found and random trials did not: the worst case of each kind, if it is worse than all random ones of
    this kind, or there is none.

    Points of the cube say little of how cases differ: most coordinates have no effect in most encounters.

    Args:
        near: Cases of the search, the worst first.
        others: Of the random trials.
    """
    known: dict[tuple[Any, ...], float] = {}
    for case in others:
        known[case.kind] = max(known.get(case.kind, -np.inf), case.harm)
    taken = set()
    for case in near:
        if case.climb >= 0 and case.kind not in taken and case.harm > known.get(case.kind, -np.inf):
            taken.add(case.kind)
            yield case
