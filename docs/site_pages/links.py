"""Dead links inside the built site, anchors too: python docs/site_pages/links.py build/docs/html."""

from __future__ import annotations

import sys
from functools import cache
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote


class Page(HTMLParser):
    """What a page leads to, and the anchors that it has."""

    def __init__(self, file: Path) -> None:
        super().__init__()
        self.targets: list[str] = []
        self.anchors: set[str] = {"", "top"}
        self.feed(file.read_text(encoding="utf-8"))

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        """Collect links and anchors."""
        for key, value in attrs:
            if key in ("href", "src") and value is not None:
                self.targets.append(value)
            elif key in ("id", "name") and value is not None:
                self.anchors.add(value)


def dead(site: Path) -> list[str]:
    """Every link that leads to no file of the site, or to no anchor of a page.

    Args:
        site: Folder of the built pages.
    """
    read = cache(Page)
    found = []
    for file in sorted(site.rglob("*.html")):
        for target in read(file).targets:
            path, _, anchor = target.partition("#")
            if ":" in path or path.startswith("//"):  # https:, mailto:, data:
                continue
            path = unquote(path.partition("?")[0])
            goal = (file.parent / path).resolve() if path else file
            goal = goal / "index.html" if goal.is_dir() else goal
            lost = not goal.is_file() or (goal.suffix == ".html" and unquote(anchor) not in read(goal).anchors)
            if lost:
                found.append(f"{file.relative_to(site)}: {target}")
    return found


if __name__ == "__main__":
    lost = dead(Path(sys.argv[1]).resolve())
    print(*lost, f"{len(lost)} dead links", sep="\n")
    sys.exit(1 if lost else 0)
