"""Every public name of qpsafe and the page that has it; read from the sources, nothing is imported."""

from __future__ import annotations

import ast
import re
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
#: Package -> its folder in the source tree.
TOPS = {"qpsafe": "qpsafe", "qpsafe.tasks": "tasks", "qpsafe.sim": "sim"}
#: The command line has a page of its own kind.
COMMANDS = ROOT / "qpsafe" / "cli"


@dataclass(frozen=True)
class Name:
    """A public name of a module.

    Attributes:
        name: Its name.
        kind: "class", "exception", "function", "kernel" or "data".
        summary: First line of its docstring, or its comment; "" without one.
        members: Public attributes and methods, of classes.
        value: What a constant is, as it stands in the source.
    """

    name: str
    kind: str
    summary: str = ""
    members: tuple[str, ...] = ()
    value: str = ""


@dataclass(frozen=True)
class Module:
    """A module of the wheel.

    Attributes:
        name: Its full name.
        summary: First line of its docstring.
        names: What is public in it, in the order of the source.
    """

    name: str
    summary: str
    names: tuple[Name, ...] = field(repr=False)

    @property
    def package(self) -> str:
        """The package whose page has it."""
        return self.name if (is_package(self.name)) else self.name.rpartition(".")[0]


def path_of(module: str) -> Path:
    """Folder or file of a module in the source tree, without suffix."""
    top = max((top for top in TOPS if f"{module}.".startswith(f"{top}.")), key=len)
    return ROOT.joinpath(TOPS[top], *module[len(top) :].split(".")[1:])


def is_package(module: str) -> bool:
    """Whether it is a folder."""
    return path_of(module).is_dir()


def summary(node: ast.AST) -> str:
    """First line of a docstring, which may go over several lines of text."""
    text = ast.get_docstring(node) or ""  # type: ignore[arg-type]
    return " ".join(text.split("\n\n")[0].split())


def assigned(node: ast.stmt) -> list[str]:
    """Names that a statement of a module or a class body binds."""
    targets = node.targets if isinstance(node, ast.Assign) else [node.target] if isinstance(node, ast.AnnAssign) else []
    return [target.id for target in targets if isinstance(target, ast.Name)]


def is_alias(node: ast.stmt) -> bool:
    """Whether a statement only gives a type a shorter name, such as `Array = NDArray[np.float64]`."""
    text = ast.unparse(getattr(node, "value", None) or ast.Constant(None))
    types = r"(NDArray|TypeVar|Callable|tuple|dict|list|Annotated|Literal|Any\b|[A-Z]\w+ \| )"
    return re.match(types, text) is not None


def comment(lines: list[str], line: int) -> str:
    """The `#:` comment above a statement.

    Args:
        lines: Of the file.
        line: Of the statement, from 1.
    """
    found: list[str] = []
    while line >= 2 and lines[line - 2].startswith("#:"):
        line -= 1
        found.insert(0, lines[line - 1].removeprefix("#:").strip())
    return " ".join(found)


def is_kernel(node: ast.FunctionDef | ast.AsyncFunctionDef) -> bool:
    """Whether it is compiled code, which only compiled code calls or which takes blocks of memory."""
    return any(re.match(r"(inline|entry|linked)\b", ast.unparse(item)) for item in node.decorator_list)


def in_class(node: ast.ClassDef) -> tuple[str, ...]:
    """Names that a class body binds, and what its methods set of `self`."""
    found: dict[str, None] = {}
    for inner in node.body:
        if isinstance(inner, ast.FunctionDef | ast.AsyncFunctionDef):
            found[inner.name] = None
            for deep in ast.walk(inner):
                if isinstance(deep, ast.Attribute) and isinstance(deep.ctx, ast.Store):
                    found[deep.attr] = None
        found |= dict.fromkeys(assigned(inner))
    return tuple(found)


def read(module: str, path: Path) -> Module:
    """A module from its file."""
    text = path.read_text(encoding="utf-8")
    tree, lines = ast.parse(text), text.splitlines()
    names = []
    for node in tree.body:
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef) and not node.name.startswith("_"):
            names.append(Name(node.name, "kernel" if is_kernel(node) else "function", summary(node)))
        elif isinstance(node, ast.ClassDef) and not node.name.startswith("_"):
            kind = "exception" if node.name.endswith(("Error", "Warning")) else "class"
            names.append(Name(node.name, kind, summary(node), in_class(node)))
        elif not is_alias(node):
            value = ast.unparse(getattr(node, "value", None) or ast.Constant(None))
            public = (name for name in assigned(node) if not name.startswith("_"))
            names += [Name(name, "data", comment(lines, node.lineno), value=value) for name in public]
    unique = {name.name: name for name in names}
    return Module(module, summary(tree), tuple(unique.values()))


@cache
def modules() -> dict[str, Module]:
    """Every module by its full name, packages among them."""
    found = {}
    for top, folder in TOPS.items():
        for path in sorted((ROOT / folder).rglob("*.py")):
            parts = path.relative_to(ROOT / folder).with_suffix("").parts
            if path.name.endswith(("_pb2.py", "__main__.py")) or not (path.parent / "__init__.py").exists():
                continue  # generated
            if path.is_relative_to(COMMANDS):
                continue
            name = ".".join((top, *parts)).removesuffix(".__init__")
            found[name] = read(name, path)
    return found


@cache
def exported() -> dict[str, str]:
    """What `import qpsafe` offers: name -> module that defines it."""
    tree = ast.parse((ROOT / "qpsafe" / "__init__.py").read_text(encoding="utf-8"))
    (table,) = [node.value for node in tree.body if assigned(node) == ["_PUBLIC"]]  # type: ignore[attr-defined]
    return ast.literal_eval(table)


@cache
def targets() -> dict[str, str]:
    """Full name of everything, members of classes too -> the name under which the site has it."""
    found = {}
    for module in modules().values():
        found[module.name] = module.name
        for name in module.names:
            here = f"{module.name}.{name.name}"
            there = f"qpsafe.{name.name}" if exported().get(name.name) == module.name else here
            for member in ("", *(f".{member}" for member in name.members)):
                found[here + member] = found[there + member] = there + member
    return found
