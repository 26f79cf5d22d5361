"""One at a time in a folder: two would play the same trials, count them twice, and take away each other's files."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from qpsafe.errors import ConfigurationError

try:
    import fcntl
except ImportError:  # Windows: nobody is kept out
    fcntl = None  # type: ignore[assignment]


@contextmanager
def alone_in(folder: Path | None) -> Iterator[None]:
    """Keep a folder for this process; whatever ends it, kill -9 too, gives the folder back.

    Args:
        folder: Made if it is not there; None for none.

    Raises:
        ConfigurationError: Somebody else is at work there.
    """
    if folder is None or fcntl is None:
        yield
        return
    folder.mkdir(parents=True, exist_ok=True)
    handle = os.open(folder, os.O_RDONLY)
    try:
        try:
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            expected = "a folder in which nobody else is at work: wait for that, or take another folder"
            raise ConfigurationError(folder, "folder", "in use by another process", expected) from None
        except OSError:  # a file system without locks
            pass
        yield
    finally:
        os.close(handle)  # also ends the lock
