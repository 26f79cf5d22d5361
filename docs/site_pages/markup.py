"""Docstrings as they are written here, plain text with names in backticks, in reStructuredText.

A name in backticks becomes a link where it names something: an attribute or a method of the class, something of the
module, of `import qpsafe`, or a class that exists once in the whole project. Anything else in backticks is code.
"""

from __future__ import annotations

import re
from functools import cache

from site_pages.catalogue import modules, targets

TICKED = re.compile(r"``.+?``|`[^`\n]+`(?:_+)?")
SECTIONS = re.compile(r"(Args|Attributes|Returns|Raises|Yields|Note|Example|Examples):$")
WORD = re.compile(r"[A-Za-z_]\w*(?:\.\w+)*(?:\(\))?")


@cache
def only_once() -> dict[str, str]:
    """Names of classes that one module has -> full name."""
    found: dict[str, list[str]] = {}
    for module in modules().values():
        for name in module.names:
            if name.kind in ("class", "exception"):
                found.setdefault(name.name, []).append(f"{module.name}.{name.name}")
    return {name: full[0] for name, full in found.items() if len(full) == 1}


def where(token: str, scopes: list[str]) -> str | None:
    """What a name in backticks stands for, by the name that the site has it under; None if for nothing of ours.

    Args:
        token: Dotted name.
        scopes: Classes and modules to look in, the nearest first.
    """
    known = targets()
    head, _, rest = token.partition(".")
    for full in (*(f"{scope}.{token}" for scope in scopes), token, f"qpsafe.{token}"):
        if full in known:
            return known[full]
    return known.get(f"{only_once().get(head, head)}.{rest}".rstrip("."))


def marked(text: str, scopes: list[str]) -> str:
    """A line in reStructuredText: code and links for what is in backticks, everything else as it stands."""
    parts, end = [], 0
    for found in TICKED.finditer(text):
        parts.append(escaped(text[end : found.start()]))
        code, end = found[0].strip("`_") if found[0].startswith("``") else found[0].strip("`"), found.end()
        goal = where(code.removesuffix("()"), scopes) if WORD.fullmatch(code) else None
        before = text[found.start() - 1 : found.start()]
        after = text[end : end + 1]
        role = f":py:obj:`{code} <{goal}>`" if goal else f"``{code}``"
        parts.append(("\\ " if before.isalnum() else "") + role + ("\\ " if after.isalnum() else ""))
    return "".join((*parts, escaped(text[end:])))


def escaped(text: str) -> str:
    """Text in which nothing is markup but the stars and dashes of a list."""
    text = re.sub(r"([*|])", r"\\\1", text.replace("\\", "\\\\"))
    return re.sub(r"(\w)_(?!\w)", r"\1\\_", re.sub(r"^(\s*)\\\*(?=\s)", r"\1*", text))


def fenced(lines: list[str]) -> list[str]:
    """Code between fences becomes an indented block."""
    found: list[str] = []
    inside = False
    for line in lines:
        if line.startswith("```"):
            inside = not inside
            found += [""] if not inside else []
        else:
            found.append(f"    {line}" if inside else line)
    return found


def converted(lines: list[str], scopes: list[str]) -> list[str]:
    """A whole docstring; what is indented outside a section is an equation or an example, and stays as it is.

    Args:
        lines: Of the docstring.
        scopes: See `where`.
    """
    found: list[str] = []
    literal, section, before = False, False, ""
    for line in fenced(lines):
        indented = line.startswith("  ")
        if line and not indented:
            literal, section = False, SECTIONS.match(line) is not None
        elif line.strip() and not (section or literal or before.strip()):
            literal = True
            found += ["::", ""]
        heading = section and not indented
        found.append(line if literal or heading or not line.strip() else marked(line, scopes))
        before = line
    return found


def scopes_of(name: str, obj: object) -> list[str]:
    """Where names in a docstring are looked up: the object itself, what holds it, and where it comes from.

    Args:
        name: Full name of the object.
        obj: The object.
    """
    parts = name.split(".")
    scopes = [".".join(parts[:k]) for k in range(len(parts), 0, -1)]
    home = getattr(obj, "__module__", None) or ""
    if home.startswith("qpsafe"):
        scopes[1:1] = [f"{home}.{getattr(obj, '__qualname__', '').split('.')[0]}", home]
    return scopes
