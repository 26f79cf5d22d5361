"""One at a time in a folder: two would play the same trials, count them twice, and take away each other's files."""

from __future__ import annotations

import os
import warnings
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from qpsafe.errors import ConfigurationError

try:
    import fcntl
except ImportError:  # Windows: nobody is kept out, which is said
    fcntl = None  # type: ignore[assignment]


@contextmanager
def alone_in(folder: Path | None) -> Iterator[None]:
    """Keep a folder for this process; whatever ends it, kill -9 too, gives the folder back.

    Folders that were made for it are taken away again where an error, or Ctrl-C, left nothing in them.

    Args:
        folder: Made if it is not there; None for none.

    Warns:
        UserWarning: It cannot be locked here: nobody is kept out.

    Raises:
        ConfigurationError: Somebody else is at work there.
    """
    if folder is None:
        yield
        return
    new = [path for path in (folder, *folder.parents) if not path.exists()]
    folder.mkdir(parents=True, exist_ok=True)
    try:
        with _locked(folder):
            yield
    except BaseException:
        for path in new:
            with suppress(OSError):  # something is in it
                path.rmdir()
        raise


@contextmanager
def _locked(folder: Path) -> Iterator[None]:
    if fcntl is None:
        _say_unguarded(folder)
        yield
        return
    handle = os.open(folder, os.O_RDONLY)
    try:
        try:
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            expected = "a folder in which nobody else is at work: wait for that, or take another folder"
            raise ConfigurationError(folder, "folder", "in use by another process", expected) from None
        except OSError:  # a file system without locks
            _say_unguarded(folder)
        yield
    finally:
        os.close(handle)  # also ends the lock


def _say_unguarded(folder: Path) -> None:
    words = f"{folder} cannot be locked here: make sure that no other process is at work in it"
    warnings.warn(words, UserWarning, stacklevel=6)
