"""Where results go: every output path is tried before the work starts, and named if nothing can be written there."""

from __future__ import annotations

import os
import time
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from tempfile import NamedTemporaryFile

import typer

from qpsafe.errors import ConfigurationError

_TRIES, _PAUSE = 50, 0.001  # of a folder that comes and goes [s]
DRAWN = (".png", ".pdf", ".svg")
"""Endings of figures."""


def output_folder(context: typer.Context, param: typer.CallbackParam, value: Path | None) -> Path | None:
    """Callback of an option: a folder that results can be written into, made later if it is not there.

    Args:
        context: The command's.
        param: The option.
        value: What was typed, None for nothing.
    """
    if value is not None and not context.resilient_parsing:
        try_folder(context.command_path, param.opts[0], value)
    return value


def output_file(*suffixes: str) -> Callable[[typer.Context, typer.CallbackParam, Path | None], Path | None]:
    """Make a callback of an option: a file that can be written, with one of these endings if any are given."""

    def callback(context: typer.Context, param: typer.CallbackParam, value: Path | None) -> Path | None:
        if value is not None and not context.resilient_parsing:
            try_file(context.command_path, param.opts[0], value, *suffixes)
        return value

    return callback


def try_folder(where: str, key: str, path: Path) -> None:
    """Write something into a folder and leave no trace; folders that are not there are made and removed again.

    Args:
        where: Who asks, for the error.
        key: The option's name, for the error.
        path: The folder.

    Raises:
        ConfigurationError: It cannot be made, or nothing can be written into it.
    """
    for left in reversed(range(_TRIES)):
        made: list[Path] = []
        try:
            for folder in (*reversed(path.parents), path):
                if not folder.exists():
                    folder.mkdir()
                    made.append(folder)
            with NamedTemporaryFile(dir=path, prefix=".qpsafe-"):
                return
        except (OSError, ValueError) as error:
            # another process that tries the same folder makes and removes it, too
            if not left or not isinstance(error, FileExistsError | FileNotFoundError):
                raise ConfigurationError(where, key, str(path), f"a folder to write into ({_reason(error)})") from None
        finally:
            with suppress(OSError):  # somebody else has put something there meanwhile
                for folder in reversed(made):
                    folder.rmdir()
        time.sleep(_PAUSE)


def try_file(where: str, key: str, path: Path, *suffixes: str) -> None:
    """Write beside a file, as its own writer will before it takes its place, and leave no trace.

    Args:
        where: Who asks, for the error.
        key: The option's name, for the error.
        path: The file.
        suffixes: Endings it may have; none for any.

    Raises:
        ConfigurationError: It is a folder or a device, its folder is not there, nothing can be written there, or it
            has another ending.
    """
    try:
        if suffixes and path.suffix.lower() not in suffixes:
            raise ConfigurationError(where, key, str(path), "a file that ends in " + " or ".join(suffixes))
        if path.exists() and not path.is_file():
            raise ConfigurationError(where, key, str(path), "a file, or a name for a new one")
        if not path.parent.is_dir():
            raise ConfigurationError(where, key, str(path), "a file in a folder that is there")
        with NamedTemporaryFile(dir=path.parent, prefix=f".{path.name}.", suffix=".part"):
            pass
    except OSError as error:
        raise ConfigurationError(where, key, str(path), f"a file that can be written ({_reason(error)})") from None
    except ValueError as error:
        if isinstance(error, ConfigurationError):
            raise
        raise ConfigurationError(where, key, str(path), f"a file that can be written ({error})") from None


def keep_apart(where: str, *files: tuple[str, Path | None]) -> None:
    """Refuse to write over a file that is read, or that is written already.

    Args:
        where: Who asks, for the error.
        files: Name of each option or argument and its file, None for none; what is read comes first.

    Raises:
        ConfigurationError: Two of them are the same file, whatever they are called.
    """
    given = [(key, path) for key, path in files if path is not None]
    for k, (key, path) in enumerate(given):
        for other, there in given[:k]:
            if _same(path, there):
                raise ConfigurationError(where, key, str(path), f"another file than {other}")


def _same(one: Path, other: Path) -> bool:
    """Whether two paths are one file; where names differ in case alone, only the disk can tell."""
    if os.path.exists(one) and os.path.exists(other):
        return os.path.samefile(one, other)
    return os.path.realpath(one) == os.path.realpath(other)


def _reason(error: Exception) -> str:
    return getattr(error, "strerror", None) or str(error)
