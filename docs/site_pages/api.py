"""The API reference: a page for each name of `import qpsafe`, and one for each package with all of its modules."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from site_pages.catalogue import Module, Name, exported, is_package, modules
from site_pages.markup import marked

#: Kind -> what autodoc shows of it; what a class inherits is shown where it has a page of its own.
MEMBERS = {"class": "   :members:\n", "exception": "   :members:\n", "function": ""}
INHERITED = "   :inherited-members: object, Exception, UserWarning, tuple, int, Enum, IntEnum, Protocol\n"
#: Longest constant that is shown in full, in characters.
SHOWN = 90


def directive(name: Name, full: str, options: str = "") -> str:
    """The directive that documents a name.

    Args:
        name: The name.
        full: The same as it is imported.
        options: More of autodoc's options, a line each.
    """
    if name.kind == "data":
        value = name.value if len(name.value) <= SHOWN else "..."
        return f".. py:data:: {full}\n   :value: {value}\n\n   {marked(name.summary, [full.rpartition('.')[0]])}\n"
    if name.kind == "kernel":  # autodoc knows no compiled functions; their blocks are described in the source
        return f".. py:function:: {full}(...)\n\n   Compiled. {marked(name.summary, [full.rpartition('.')[0]])}\n"
    return f".. auto{name.kind}:: {full}\n{MEMBERS[name.kind]}{options}"


def title(text: str, line: str = "=") -> str:
    """A heading of reStructuredText."""
    return f"{text}\n{line * len(text)}\n"


def name_page(name: Name, module: str) -> str:
    """Page of a name that `import qpsafe` offers."""
    full = f"qpsafe.{name.name}"
    options = INHERITED if name.kind == "class" else ""
    return "\n".join([title(full), f"Defined in :py:mod:`{module}`.\n", directive(name, full, options)])


def module_part(module: Module) -> Iterator[str]:
    """What a package's page says of a module."""
    yield title(module.name.rpartition(".")[2], "-")
    yield f".. automodule:: {module.name}\n   :no-members:\n"
    here = [name for name in module.names if exported().get(name.name) != module.name]
    there = [name.name for name in module.names if name not in here]
    if there:
        yield "With a page of their own: " + ", ".join(f":py:obj:`qpsafe.{name}`" for name in there) + ".\n"
    for name in here:
        yield directive(name, f"{module.name}.{name.name}")


def package_page(package: str, inside: list[Module]) -> str:
    """Page of a package: each of its modules with all public names."""
    parts = [title(package), f".. automodule:: {package}\n   :no-members:\n"]
    if package == "qpsafe":
        parts = [title("qpsafe, its modules"), ".. py:module:: qpsafe\n"]
    for module in inside:
        parts += module_part(module)
    return "\n".join(parts)


def packages() -> dict[str, list[Module]]:
    """Package -> its modules, without the packages in it."""
    found: dict[str, list[Module]] = {name: [] for name in modules() if is_package(name)}
    for module in modules().values():
        if not is_package(module.name):
            found[module.name.rpartition(".")[0]].append(module)
    return {package: inside for package, inside in found.items() if inside}


def index(rooms: dict[str, list[Module]]) -> str:
    """The page that leads to the others."""
    everything = modules()
    lines = ["# API", "", "What `import qpsafe` offers, a page each:", "", "| name | what it is |", "|---|---|"]
    for name, module in sorted(exported().items()):
        (found,) = [item for item in everything[module].names if item.name == name]
        lines.append(f"| [{name}](qpsafe/{name}.rst) | {found.summary.replace('|', chr(92) + '|')} |")
    lines += ["", "## Packages", "", "All modules with all of their public names:", ""]
    lines += ["| package | what it is for |", "|---|---|"]
    for package in rooms:
        lines.append(f"| [{package}](packages/{package}.rst) | {everything[package].summary} |")
    tree = ["", "```{toctree}", ":hidden:", ":glob:", "", "qpsafe/*", "packages/*", "```", ""]
    return "\n".join(lines + tree)


def write(folder: Path) -> None:
    """Write the pages, those that changed only: Sphinx reads what is new.

    Args:
        folder: Of the API reference; git ignores it.
    """
    rooms = packages()
    pages = {"index.md": index(rooms)}
    for name, module in exported().items():
        (found,) = [item for item in modules()[module].names if item.name == name]
        pages[f"qpsafe/{name}.rst"] = name_page(found, module)
    for package, inside in rooms.items():
        pages[f"packages/{package}.rst"] = package_page(package, inside)
    for old in folder.rglob("*.*"):
        if old.relative_to(folder).as_posix() not in pages:
            old.unlink()
    for path, text in pages.items():
        file = folder / path
        file.parent.mkdir(parents=True, exist_ok=True)
        if not file.exists() or file.read_text(encoding="utf-8") != text:
            file.write_text(text, encoding="utf-8")
