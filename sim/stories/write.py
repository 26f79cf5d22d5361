"""A story as the text of a file: what a program made up, to be read, changed and told again."""

from __future__ import annotations

from typing import Any

from qpsafe.sim.stories.steps import StoryTable


def story_text(table: StoryTable) -> str:
    """TOML that `parse_story` reads as the same story, without what is left at its default."""
    said = table.model_dump(exclude_defaults=True)
    lines = [f"{key} = {_value(value)}" for key, value in said.items() if key != "person"]
    for person in said["person"]:
        lines += ["", "[[person]]"]
        lines += [f"{key} = {_value(value)}" for key, value in person.items() if key != "step"]
        for step in person.get("step", []):
            lines += ["", "[[person.step]]"]
            lines += [f"{key} = {_value(value)}" for key, value in step.items()]
    return "\n".join(lines).lstrip("\n") + "\n"


def _value(value: Any) -> str:
    """A value as TOML has it; numbers to the last bit."""
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, str):
        # whatever else a text holds may stand between TOML's quotes
        return (
            '"' + "".join(f"\\u{ord(c):04x}" if c in '"\\' or ord(c) < 32 or ord(c) == 127 else c for c in value) + '"'
        )
    if isinstance(value, list | tuple):
        return "[" + ", ".join(_value(part) for part in value) + "]"
    if isinstance(value, dict):
        return "{ " + ", ".join(f"{key} = {_value(part)}" for key, part in value.items()) + " }"
    return repr(value)
