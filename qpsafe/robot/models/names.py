"""Names of frames where a file gives one name to a site, a body or link, and a joint."""

from __future__ import annotations


def unique_name(name: str, kind: str, taken: set[str]) -> str:
    """`name`, or "name (kind)" where that is taken; the result is taken then.

    Args:
        name: As wished.
        kind: What bears it, e.g. ``joint``.
        taken: Names that are; the result is added.
    """
    unique, number = name, 1
    while unique in taken:
        unique = f"{name} ({kind})" if number == 1 else f"{name} ({kind} {number})"
        number += 1
    taken.add(unique)
    return unique


def name_in_file(frame: str) -> str:
    """The name that the model file has for what a frame stands for."""
    name, _, rest = frame.rpartition(" (")
    return name if name and rest.split(" ")[0].rstrip(")") in ("body", "joint") and rest.endswith(")") else frame
