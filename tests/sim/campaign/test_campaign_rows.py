"""Rows of trials: every column is named, typed and explained; what is no row is refused; order does not matter."""

from __future__ import annotations

from itertools import permutations

import made_up_trials
import numpy as np
import pytest

from qpsafe.sim.campaign.plan import Plan
from qpsafe.sim.campaign.trials.rows import COLUMNS, DTYPES, NAMES, RowError, columns_of, joined, of_controller

PLAN = Plan(trials=6, controllers=("stop", "none", "default"))
ROWS = [row for trial in range(6) for row in made_up_trials.run(PLAN, trial)]


def test_every_column_has_one_name_a_unit_if_it_is_a_number_and_a_line_of_meaning() -> None:
    assert len(set(NAMES)) == len(NAMES)
    for column in COLUMNS:
        assert bool(column.unit) == (column.kind in (int, float)), column
        assert 10 < len(column.meaning) < 200, column
        assert "|" not in column.meaning, column  # it stands in tables


def test_columns_hold_what_rows_held() -> None:
    columns = columns_of(ROWS)
    for column in COLUMNS:
        values = columns[column.name]
        assert values.dtype.type is DTYPES[column.kind]
        for value, row in zip(values.tolist(), ROWS, strict=True):
            assert type(value) is column.kind
            assert value == row[column.name] or (value != value and row[column.name] != row[column.name])


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"contact": 1}, "contact = 1"),
        ({"stops": True}, "stops = True"),
        ({"stops": 1.0}, "stops = 1.0"),
        ({"energy": None}, "energy = None"),
        ({"motion": 3}, "motion = 3"),
        ({"new": 3}, "new"),
    ],
)
def test_what_is_no_row_is_refused(change: dict, said: str) -> None:
    with pytest.raises(RowError, match=said):
        columns_of([ROWS[0] | change])
    with pytest.raises(RowError, match="energy"):
        columns_of([{key: value for key, value in ROWS[0].items() if key != "energy"}])


def test_parts_in_any_order_and_trials_twice_give_the_same_rows() -> None:
    parts = [columns_of(made_up_trials.run(PLAN, trial)) for trial in (3, 0, 4, 1)]
    straight = columns_of([row for trial in (0, 1, 3, 4) for row in made_up_trials.run(PLAN, trial)])
    for order in permutations(range(4)):
        found = joined([parts[k] for k in (*order, order[0])], PLAN.controllers)
        assert all(np.array_equal(found[name], straight[name], equal_nan=found[name].dtype == float) for name in NAMES)
    assert all(len(values) == 0 for values in joined([], PLAN.controllers).values())


def test_rows_of_a_controller_are_in_order_of_trials() -> None:
    mine = of_controller(joined([columns_of(ROWS[9:]), columns_of(ROWS[:9])], PLAN.controllers), "none")
    assert mine["trial"].tolist() == list(range(6))
    assert set(mine["controller"].tolist()) == {"none"}
