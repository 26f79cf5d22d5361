"""A campaign's folder is what its manifest says, or is refused by name: rows, values of the manifest, versions."""

from __future__ import annotations

import json
import os
import shutil
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import made_up_trials
import pytest

from qpsafe.errors import ConfigurationError
from qpsafe.sim.campaign import manifest, store
from qpsafe.sim.campaign.manifest import MANIFEST, read_manifest
from qpsafe.sim.campaign.plan import Plan
from qpsafe.sim.campaign.runner import run_campaign, stored_results
from qpsafe.sim.campaign.trials.rows import COLUMNS

parquet = pytest.importorskip("pyarrow.parquet")
arrow = pytest.importorskip("pyarrow")

PLAN = Plan(trials=8, seed=3, controllers=("none", "stop", "default"))
Tamper = Callable[[Any], Any]


@pytest.fixture(scope="module")
def played(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("played") / "kept"
    run_campaign(PLAN, folder, trial=made_up_trials.run)
    return folder


@pytest.fixture
def folder(played: Path, tmp_path: Path) -> Path:
    return Path(shutil.copytree(played, tmp_path / "kept"))


def column(name: str, change: Callable[[list[Any]], list[Any]]) -> Tamper:
    def tamper(table: Any) -> Any:
        place = table.schema.get_field_index(name)
        values = arrow.array(change(table[name].to_pylist()), table.schema.field(name).type)
        return table.set_column(place, table.schema.field(name), values)

    return tamper


def without(*rows: int) -> Tamper:
    return lambda table: table.filter(arrow.array([k not in rows for k in range(len(table))]))


def one(k: int, value: Any) -> Callable[[list[Any]], list[Any]]:
    return lambda values: [*values[:k], value, *values[k + 1 :]]


def whose(name: bytes | None) -> Tamper:
    def tamper(table: Any) -> Any:
        meta = {key: value for key, value in table.schema.metadata.items() if key != b"plan"}
        return table.replace_schema_metadata(meta if name is None else meta | {b"plan": name})

    return tamper


TAMPERED: dict[str, Tamper] = {
    **{f"null {c.name}": column(c.name, one(4, None)) for c in COLUMNS},
    "a row less": without(4),
    "rows of one controller": without(*range(1, 24, 3)),
    "each lacks another": without(0, 4, 8),
    "a row twice": lambda table: arrow.concat_tables([table, table.slice(4, 1)]),
    "another order": lambda table: table.take(arrow.array([*range(3, 24), 0, 1, 2])),
    "negative": column("trial", lambda values: [v - 1 for v in values]),
    "another number": column("trial", one(4, 5)),
    "another seed": column("seed", lambda values: [v + 5000 for v in values]),
    "one seed": column("seed", one(7, 0)),
    "unknown controller": column("controller", one(2, "brave")),
    "another controller": column("controller", one(2, "stop")),
    "another plan": whose(b"0" * 64),
    "no text": whose(b"\xff"),
    "no seconds": lambda table: table.replace_schema_metadata({}),
    "another kind": lambda table: table.set_column(0, "trial", table["trial"].cast("float64")),
    "a column less": lambda table: table.drop_columns(["energy"]),
}


@pytest.mark.parametrize("name", TAMPERED)
def test_rows_that_are_not_the_plans_are_refused_whoever_reads_them(folder: Path, name: str) -> None:
    (file,) = folder.glob("*.parquet")
    parquet.write_table(TAMPERED[name](parquet.read_table(file)), file)
    for read in (lambda: stored_results(folder), lambda: run_campaign(PLAN, folder, trial=made_up_trials.run)):
        with pytest.raises(ConfigurationError, match=file.name):
            read()


def test_trials_of_another_campaign_are_refused_also_beside_our_own(folder: Path, tmp_path: Path) -> None:
    for k, change in enumerate(({"seed": 50}, {"lag": 0.02}, {"sensor": "sharp"}, {"controllers": ("none", "stop")})):
        other = tmp_path / f"other-{k}"
        run_campaign(replace(PLAN, trials=3, **change), other, trial=made_up_trials.run)  # type: ignore[arg-type]
        (file,) = other.glob("*.parquet")
        there = folder / f"trials-{k}.parquet"
        shutil.copy(file, there)
        with pytest.raises(ConfigurationError, match=there.name):
            stored_results(folder)
        there.unlink()
    assert stored_results(folder).trials == 8


def test_files_of_before_that_do_not_say_whose_they_are_are_taken_by_their_seeds(folder: Path) -> None:
    (file,) = folder.glob("*.parquet")
    parquet.write_table(whose(None)(parquet.read_table(file)), file)
    assert stored_results(folder).trials == 8
    parquet.write_table(column("seed", lambda values: [v + 1 for v in values])(parquet.read_table(file)), file)
    with pytest.raises(ConfigurationError, match=file.name):
        stored_results(folder)


# The manifest

WRONG: list[tuple[str, Any]] = [
    *(("plan." + key, value) for key in PLAN.to_dict() for value in ([], 3.5, {}, True, [3])),
    *(("plan." + key, None) for key in ("robot", "motions", "controllers", "sensor", "lag", "trials", "seed")),
    *(("plan.trials", value) for value in ("6", 0, -1, 10**30, "x")),
    *(("plan.seed", value) for value in ("x", -1, 2**60, 4)),
    *(("plan.controllers", value) for value in ("stop", 5, ["none", "stop"], ["none", "stop", "stop"], [None])),
    ("plan.lag", 0.02), ("plan.people", "else.toml"), ("plan.robot", "iiwa14"), ("plan.motions", ["hold"]),
    *(("versions", value) for value in ([], "x", None, 3, {"numpy": 2}, [["numpy", "2"]])),
    *(("identity", value) for value in ([], None, 3, {})),
    *(("plan", value) for value in ([], None, {}, {"seed": 3}, "x")),
    *(("format", value) for value in (None, 1, "other")),
]  # fmt: skip


@pytest.mark.parametrize(("key", "value"), WRONG, ids=str)
def test_a_wrong_value_of_the_manifest_is_named(folder: Path, key: str, value: Any) -> None:
    said = json.loads((folder / MANIFEST).read_text())
    place, _, name = key.rpartition(".")
    (said[place] if place else said)[name] = value
    (folder / MANIFEST).write_text(json.dumps(said))
    for read in (lambda: stored_results(folder), lambda: run_campaign(PLAN, folder, trial=made_up_trials.run)):
        with pytest.raises(ConfigurationError, match=r"manifest\.json"):
            read()


def test_a_manifest_nested_too_deep_is_none(folder: Path) -> None:
    (folder / MANIFEST).write_text("[" * 200_000)
    with pytest.raises(ConfigurationError, match=r"manifest\.json"):
        stored_results(folder)


def test_versions_of_all_who_played_are_kept(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    before = read_manifest(folder).versions
    now = manifest.versions_now() | {"scipy": "99.1", "python": "9.9"}
    monkeypatch.setattr(store, "versions_now", lambda: now)
    assert run_campaign(PLAN, folder, trial=made_up_trials.run).versions == before  # nothing was left to play
    longer = run_campaign(replace(PLAN, trials=9), folder, trial=made_up_trials.run)
    both = before | {"scipy": f"{before['scipy']}, 99.1", "python": f"{before['python']}, 9.9"}
    assert longer.versions == stored_results(folder).versions == both
    run_campaign(replace(PLAN, trials=10), folder, trial=made_up_trials.run)
    assert read_manifest(folder).versions == both


# What is left of a campaign without a trial


class StopError(BaseException):
    """As Ctrl-C is."""


@pytest.mark.parametrize("error", [StopError, ConfigurationError, OSError])
def test_before_its_first_trial_it_leaves_nothing_that_was_not_there(error: Any, tmp_path: Path) -> None:
    def stops(plan: Plan, trial: int) -> list[dict[str, Any]]:
        raise error("x", "y", "z", "w") if error is ConfigurationError else error()

    there = tmp_path / "there"
    there.mkdir()
    (there / "notes.txt").touch()
    for out in (tmp_path / "new" / "deep", there):
        with pytest.raises(Exception if error is not StopError else StopError):
            run_campaign(PLAN, out, trial=stops)
    assert sorted(os.listdir(tmp_path)) == ["there"]
    assert os.listdir(there) == ["notes.txt"]
    run_campaign(PLAN, there, trial=made_up_trials.run)
    with pytest.raises(Exception if error is not StopError else StopError):
        run_campaign(replace(PLAN, trials=12), there, trial=stops)
    assert stored_results(there).trials == 8
