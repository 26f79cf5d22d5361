"""docs/reference/files.md lists every key of every TOML file as the schemas have it, default and unit too."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Iterator
from pathlib import Path
from typing import Any, get_args

import pytest
from pydantic import BaseModel
from pydantic.fields import FieldInfo

from qpsafe.ranging.sensor_file import ArrayFile
from qpsafe.robot.robot_file.schema import RobotFile
from qpsafe.sensing import cell_file
from qpsafe.sensing.skin import calibration
from qpsafe.sensing.skin.spot_file import SpotFile
from qpsafe.sim.campaign.people.tables import PeopleTable
from qpsafe.sim.campaign.plan import PlanFile
from qpsafe.sim.stories.steps import StoryTable
from qpsafe.tasks.program_tables import ProgramFile

PAGE = (Path(__file__).resolve().parents[1] / "docs" / "reference" / "files.md").read_text(encoding="utf-8")
ROOTS: dict[str, type[BaseModel]] = {
    "Program": ProgramFile,
    "Cell": cell_file.CellFile,
    "Story": StoryTable,
    "People": PeopleTable,
    "Spots": SpotFile,
    "Arrays": ArrayFile,
    "Robot": RobotFile,
    "Calibration": calibration._File,
    "Campaign": PlanFile,
}
Row = tuple[str, str, str]  # key, unit, default


def tables(annotation: Any) -> Iterator[type[BaseModel]]:
    """Every table that a value of this type may hold, directly."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        yield annotation
    for part in get_args(annotation):
        yield from tables(part)


def reachable(model: type[BaseModel]) -> list[type[BaseModel]]:
    found = [model]
    for table in found:
        for field in table.model_fields.values():
            found += [other for other in tables(field.annotation) if other not in found]
    return found


def documented(section: str) -> list[dict[str, Row]]:
    """The tables of a section of the page: key -> row."""
    text = PAGE.split(f"\n## {section}\n")[1].split("\n## ")[0]
    found = []
    for part in text.split("\n### ")[1:]:
        rows = re.findall(r"^\| `(\w+)` \| (.*?) ?\| (.*?) \|", part, re.MULTILINE)
        assert len(rows) == part.count("\n|") - 2, part  # nothing overlooked
        found.append({key: (key, unit.strip(), default) for key, unit, default in rows})
    return found


def numeric(annotation: Any) -> bool:
    return annotation in (int, float) or any(numeric(part) for part in get_args(annotation))


def default_of(field: FieldInfo) -> Any:
    """The default as TOML has it; None where there is nothing to write."""
    value = field.get_default(call_default_factory=True)
    return None if isinstance(value, BaseModel) or value in ([], {}, ()) else value


@pytest.mark.parametrize("section", ROOTS)
def test_the_page_and_the_schema_have_the_same_keys(section: str) -> None:
    models, pages = reachable(ROOTS[section]), documented(section)
    schema = sorted(sorted(model.model_fields) for model in models)
    assert sorted(sorted(table) for table in pages) == schema
    for model in models:
        kind = model.model_fields.get("do")  # tables of a union differ in it
        word = f'with `do = "{get_args(kind.annotation)[0]}"`' if kind else ""
        matching = [
            table
            for table, part in zip(pages, PAGE.split(f"\n## {section}\n")[1].split("\n### ")[1:], strict=False)
            if set(table) == set(model.model_fields) and word in part.splitlines()[0]
        ]
        good = [
            table for table in matching if all(agrees(field, table[key]) for key, field in model.model_fields.items())
        ]
        assert good, (model.__name__, matching)


def agrees(field: FieldInfo, row: Row) -> bool:
    """Whether a row says whether the key is required, its default, and a unit if it is a number."""
    _, unit, default = row
    if numeric(field.annotation) and not unit:
        return False
    if field.is_required():
        return default == "required"
    value = default_of(field)
    return default == "none" if value is None else tomllib.loads(f"x = {default.strip('`')}")["x"] == value
