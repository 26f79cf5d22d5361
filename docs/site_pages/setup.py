"""Ties the generated pages to Sphinx."""

from __future__ import annotations

from importlib import import_module
from pathlib import Path
from typing import Any

from docutils import nodes
from docutils.parsers.rst import Directive
from sphinx.addnodes import pending_xref, pending_xref_condition

from site_pages import api, commands
from site_pages.catalogue import ROOT, modules, targets
from site_pages.markup import converted, scopes_of, where

BEFORE_NAPOLEON = 400
RECORDINGS = ROOT / "build" / "recordings"


def on_init(app: Any) -> None:
    """Pages that are made from the code, before Sphinx looks which pages there are.

    Everything is imported once here, and not by each of the processes that read pages.
    """
    for module in modules():
        import_module(module)
    api.write(Path(app.srcdir) / "reference" / "api")
    commands.write(Path(app.srcdir) / "reference" / "api")


def on_docstring(app: Any, what: str, name: str, obj: object, options: Any, lines: list[str]) -> None:
    """A docstring as reStructuredText, in place."""
    lines[:] = converted(lines, scopes_of(name, obj))


def on_types(app: Any, doctree: nodes.document) -> None:
    """Types in signatures lead to what they name in their own module, or nowhere.

    Sphinx would search all names of the project for one that ends so, for every one of them.
    """
    for node in list(doctree.findall(pending_xref)):
        if node.get("refdomain") == "py" and node.get("reftype") != "mod" and not node.get("refexplicit"):
            home = node.get("py:module") or ""
            goal = where(node["reftarget"], [f"{home}.{node.get('py:class')}", home])
            if goal is None:
                first = node.children[0]  # of a long and a short form the first is the one to show
                node.replace_self(first.children if isinstance(first, pending_xref_condition) else node.children)
            else:
                node["reftarget"], node["refspecific"] = goal, False


def on_missing(app: Any, env: Any, node: pending_xref, content: nodes.Element) -> nodes.Element | None:
    """An attribute that its class describes in its own text: to the class."""
    owner, _, name = node.get("reftarget", "").rpartition(".")
    if node.get("refdomain") != "py" or not name or node["reftarget"] not in targets():
        return None
    return env.domains.python_domain.resolve_xref(env, node["refdoc"], app.builder, "obj", owner, node, content)


class Recording(Directive):
    """A moving picture of build/recordings, with its caption; nothing if `docs/recordings.py` has not made it."""

    required_arguments = 1
    has_content = True

    def run(self) -> list[nodes.Node]:
        """The frame and what is written under it."""
        env = self.state.document.settings.env
        file, up = f"{self.arguments[0]}.html", "../" * env.docname.count("/")
        if not (RECORDINGS / file).exists():
            return []
        frame = f'<iframe class="recording" loading="lazy" src="{up}{file}" title="{self.arguments[0]}"></iframe>'
        caption = nodes.paragraph()
        self.state.nested_parse(self.content, self.content_offset, caption)
        return [nodes.raw("", frame, format="html"), *caption.children]


def setup(app: Any) -> dict[str, Any]:
    """What Sphinx calls."""
    app.connect("builder-inited", on_init)
    app.connect("autodoc-process-docstring", on_docstring, priority=BEFORE_NAPOLEON)
    app.connect("doctree-read", on_types)
    app.add_directive("recording", Recording)
    app.connect("missing-reference", on_missing)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
