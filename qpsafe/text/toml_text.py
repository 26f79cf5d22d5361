"""A TOML file that a person edits: read, checked against its tables, and what is wrong in it named with its line."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TypeVar

from pydantic import BaseModel, ValidationError

from qpsafe.errors import ConfigurationError
from qpsafe.text.complaints import expected_words
from qpsafe.text.lines import line_of, toml_lines
from qpsafe.text.toml_parse import read_bounded, toml_table

Keys = Sequence[str | int]
Model = TypeVar("Model", bound=BaseModel)


class TomlText:
    """The text of a file, which knows where each of its keys stands.

    Args:
        text: What the file says.
        path: Names the file in errors.
        error: Kind of the errors to raise.
    """

    def __init__(self, text: str, path: str | Path, error: type[ConfigurationError] = ConfigurationError) -> None:
        self.text, self.path, self._error = text, path, error

    @classmethod
    def read(cls, path: Path, error: type[ConfigurationError] = ConfigurationError) -> TomlText:
        """Read a file.

        Raises:
            ConfigurationError: Of the kind `error`: the file cannot be read.
        """
        try:
            return cls(read_bounded(path), path, error)
        except (OSError, ValueError) as problem:
            raise error(path, "file", str(problem), "a readable TOML file") from None

    def checked(
        self, model: type[Model], is_key: Callable[[Keys, str | int], bool] = lambda before, key: True
    ) -> Model:
        """The text as the tables of `model`.

        Args:
            model: What the file may say.
            is_key: Whether a part of pydantic's location, after the keys before it, is a key of the file; it also names
                the kinds of a union.

        Raises:
            ConfigurationError: Of the text's kind: no TOML, or the first value that is wrong, with file and line.
        """
        try:
            table = toml_table(self.text)
        except tomllib.TOMLDecodeError as problem:
            found = re.search(r"at line (\d+)", str(problem))
            line = found.group(1) if found else str(len(toml_lines(self.text)))
            raise self._error(f"{self.path}:{line}", "file", str(problem), "well-formed TOML") from None
        try:
            return model.model_validate(table)
        except ValidationError as problem:
            first = problem.errors()[0]
            keys: list[str | int] = []
            for part in first["loc"]:
                if is_key(keys, part):
                    keys.append(part)
            value = "nothing" if first["type"] == "missing" else first["input"]
            if first["type"] in ("union_tag_invalid", "union_tag_not_found"):  # the key that says which kind it is
                keys.append(first["ctx"]["discriminator"].strip("'"))
                value = first["ctx"].get("tag", "nothing")
            raise self.wrong(keys, value, expected_words(first)) from None

    def wrong(self, keys: Keys, value: object, expected: str) -> ConfigurationError:
        """An error about the value of a key such as ``("segment", 2, "to")``, of the text's kind.

        Args:
            keys: Where the value is.
            value: As found.
            expected: Instead, in words.
        """
        name = ""
        for key in keys:
            name += f"[{key}]" if isinstance(key, int) else f".{key}" if name else key
        return self._error(f"{self.path}:{line_of(self.text, keys)}", name, value, expected)
