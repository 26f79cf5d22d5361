"""What is known of a trial, one row for each controller: names, kinds, units and definitions.

Files, report and documentation have them from here. Units are SI; NaN stands where a figure does not apply.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from qpsafe.errors import QpsafeError

#: Rows by columns: name -> array of one value a row.
Columns = dict[str, NDArray[Any]]

#: What the robot did where it was touched, one tick before: the first one that holds, from the right.
CLASSES = ("none", "rest", "away", "sideways", "towards", "clamped")


class Column(NamedTuple):
    """A column.

    Attributes:
        name: Its name.
        kind: `int`, `float`, `bool` or `str`.
        unit: SI; empty for words, "1" for shares and counts.
        meaning: Its definition in a line.
    """

    name: str
    kind: type
    unit: str
    meaning: str


COLUMNS = (
    Column(
        "trial", int, "1", "number of the trial in its campaign, from 0; all controllers meet the same people in it"
    ),
    Column("seed", int, "1", "of everything random in the trial: the campaign's first seed + trial"),
    Column("motion", str, "", "what the robot does: hold (a pose), line, pick (and place), or a program's file"),
    Column("controller", str, "", "name of the controller"),
    Column(
        "sensor",
        str,
        "",
        "what it sees people by: ideal, sharp, vl53l5cx, depth, some joined by +, perfect (true points), none",
    ),
    Column("simulated", float, "s", "how long the trial lasted, in its own time"),
    Column("contact", bool, "", "whether the robot touched a person or what they carry"),
    Column("contact_time", float, "s", "when it first did"),
    Column(
        "contact_class",
        str,
        "",
        "none, or what the robot did at the touched point one tick before: clamped, towards, "
        "sideways, away, rest (the first that holds)",
    ),
    Column(
        "contact_region",
        str,
        "",
        "touched part of the person: torso, neck, head, pelvis, shoulders, thigh, shank, foot, "
        "upper_arm, forearm, hand, board",
    ),
    Column("contact_frame", str, "", "touching body of the robot"),
    Column("moving", bool, "", "the robot's touching point moved faster than 1 mm/s one tick before"),
    Column("towards", bool, "", "it moved faster than 0.1 m/s towards the person one tick before"),
    Column("clamped", bool, "", "the point moved towards a part with furniture, floor or the robot right behind it"),
    Column("towards_speed", float, "m/s", "speed of that point towards the person one tick before contact"),
    Column("robot_speed", float, "m/s", "speed of that point one tick before contact, in any direction"),
    Column(
        "closing_speed", float, "m/s", "speed at which robot and person approached each other one tick before contact"
    ),
    Column("near_seen", bool, "", "the touched part lay within 0.3 m of a point that was seen"),
    Column("energy", float, "J", "of the first contact: E = ½ µ v², v closing speed, 1/µ = 1/m_H + 1/m_R"),
    Column("energy_limit", float, "J", "what the touched region may take"),
    Column("energy_share", float, "1", "energy / energy_limit"),
    Column("force", float, "N", "largest force of the first contact by the same model: v √(µ k), k of the region"),
    Column("force_limit", float, "N", "what the touched region may take"),
    Column("distance", float, "m", "smallest true distance of robot and people in the trial; 0 or below at contact"),
    Column("distance_time", float, "s", "when it was smallest"),
    Column(
        "under_sp",
        float,
        "s",
        "up to a contact, how long the robot moved with its nearest point nearer to people than S_p of its approach",
    ),
    Column("first_sight", float, "s", "when the controller first saw anybody; NaN: never"),
    Column("first_sight_distance", float, "m", "true distance of robot and people then; NaN: over 1 m"),
    Column(
        "sight_in_time",
        bool,
        "",
        "whoever first came nearer than S_p had been seen by then, or nobody did; one told nothing sees nobody",
    ),
    Column(
        "progress",
        float,
        "1",
        "share of its work that was done: path time done / path time that is done without people",
    ),
    Column("lost_time", float, "s", "path time that is done without people - path time done"),
    Column("stops", int, "1", "how often the robot stopped with its path waiting; 0 where it has no path"),
    Column("suspensions", int, "1", "how often the work was suspended"),
    Column("path_error", float, "m", "largest distance of the tool from its path while not suspended"),
    Column(
        "reversals",
        int,
        "1",
        "how often joints' commanded speeds turned round, from above 0.02 rad/s to below -0.02 or back",
    ),
    Column("furniture", bool, "", "whether the robot touched furniture or the floor"),
    Column("furniture_distance", float, "m", "smallest true distance to them"),
    Column("self", bool, "", "whether the robot touched itself"),
    Column("self_distance", float, "m", "smallest true distance of its links that are not neighbours"),
    Column(
        "limit_excess",
        float,
        "1",
        "largest excess of the reference over a joint's limit: speed and acceleration relative to it, position in rad",
    ),
    Column("bad_ticks", int, "1", "ticks that the controller itself called bad: unusable input, or a fault"),
    Column("search", float, "1", "harm in one smooth number, larger is worse: what the search for the worst maximises"),
)
NAMES = tuple(column.name for column in COLUMNS)
#: numpy's kind of each of ours.
DTYPES = {int: np.int64, float: np.float64, bool: np.bool_, str: np.str_}
_WHOLE = (int, np.integer)
_ACCEPTED: dict[type, tuple[type, ...]] = {
    int: _WHOLE,
    float: (float, np.floating, *_WHOLE),
    bool: (bool, np.bool_),
    str: (str,),
}


class RowError(QpsafeError):
    """A trial gave something that is not a row: a mistake in the program that plays trials."""


def columns_of(rows: Sequence[Mapping[str, Any]]) -> Columns:
    """Rows as columns.

    Raises:
        RowError: A row lacks a value, has one too many, or one of another kind.
    """
    for row in rows:
        if row.keys() != set(NAMES):
            raise RowError(
                f"a trial's row lacks {sorted(set(NAMES) - row.keys())}, has {sorted(row.keys() - set(NAMES))}"
            )
        for column in COLUMNS:
            value = row[column.name]
            if not isinstance(value, _ACCEPTED[column.kind]) or (isinstance(value, bool) and column.kind is not bool):
                raise RowError(f"a trial's row: {column.name} = {value!r}: expected {column.kind.__name__}")
    return {c.name: np.array([row[c.name] for row in rows], dtype=DTYPES[c.kind]) for c in COLUMNS}


def joined(parts: Iterable[Columns], controllers: Sequence[str]) -> Columns:
    """All parts, by trial and then in the order of the controllers: whatever the order of the parts.

    A trial that is in several parts is taken once.

    Args:
        parts: With whole trials, all their controllers in the same part.
        controllers: Names in their order.
    """
    found = list(parts) or [columns_of([])]
    whole = {name: np.concatenate([part[name] for part in found]) for name in NAMES}
    place = {name: k for k, name in enumerate(controllers)}
    rank = np.array([place[str(name)] for name in whole["controller"]], dtype=np.int64)
    keys = whole["trial"] * max(len(controllers), 1) + rank
    _, first = np.unique(keys, return_index=True)
    return {name: values[first] for name, values in whole.items()}


def of_controller(columns: Columns, name: str) -> Columns:
    """The rows of one controller, in order of the trials."""
    mine = columns["controller"] == name
    return {key: values[mine] for key, values in columns.items()}
