"""Text as a string of TOML."""

from __future__ import annotations

_ESCAPES = {code: f"\\u{code:04x}" for code in (*range(0x20), 0x7F)}
_ESCAPES |= {ord(char): f"\\{word}" for char, word in (('"', '"'), ("\\", "\\"), ("\n", "n"), ("\r", "r"), ("\t", "t"))}


def toml_string(value: str) -> str:
    """The text in quotes, in one line, whatever stands in it; also fine as a key.

    Args:
        value: The text.
    """
    return f'"{value.translate(_ESCAPES)}"'
