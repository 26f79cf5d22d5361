"""Files that are chosen for a robot and may be corrected by hand: those that were, are not written over."""

from __future__ import annotations

import hashlib
import re
from pathlib import Path

from qpsafe.text.whole_file import whole_file

#: Begins the last line of a file that was written here; 16 hexadecimal digits of all before it follow.
MARK = "# written by qpsafe, kept as it is once anything is changed: "


def marked(text: str) -> str:
    """A text with the line that tells later whether it was changed; one that it has gives way."""
    body = unmarked(text)
    body += "" if body.endswith("\n") else "\n"
    return f"{body}{MARK}{_digest(body)}\n"


def unmarked(text: str) -> str:
    """A text without that line."""
    body, mark, digest = text.rpartition(MARK)
    return body if mark and re.fullmatch(r"[0-9a-f]{16}\s*", digest) else text


def by_hand(path: Path) -> bool:
    """Whether a file is there that somebody has changed or written, or an older qpsafe that left no such line."""
    try:
        text = path.read_text(encoding="utf-8")
    except FileNotFoundError:
        return False
    except (OSError, UnicodeDecodeError):
        return True
    body = unmarked(text)
    return text != f"{body}{MARK}{_digest(body)}\n"


def write_marked(path: Path, text: str) -> None:
    """Write a file whole, with the line; one that says the same already stays.

    Args:
        path: Of the file.
        text: With or without the line.
    """
    write_whole(path, marked(text).encode())


def write_whole(path: Path, content: bytes) -> None:
    """Write a file whole, and its folder; one that says the same already stays.

    Args:
        path: Of the file.
        content: Of the file.
    """
    if path.is_file() and path.read_bytes() == content:
        return
    path.parent.mkdir(parents=True, exist_ok=True)
    with whole_file(path) as part:
        part.write_bytes(content)


def _digest(body: str) -> str:
    return hashlib.sha256(body.encode()).hexdigest()[:16]
