"""Who plays trials: this process, processes of our own, or any executor; and what happens when a process dies.

Work is handed out a few pieces ahead, so memory is bounded, and comes back in any order.
"""

from __future__ import annotations

import multiprocessing
import os
import signal
from collections import deque
from collections.abc import Callable, Generator, Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, Executor, Future, ProcessPoolExecutor, wait
from contextlib import contextmanager, suppress
from threading import Thread
from typing import Any, Protocol, TypeVar

from qpsafe.errors import ConfigurationError, QpsafeError
from qpsafe.extras import require

Piece = TypeVar("Piece")
Answer = TypeVar("Answer")

_GUARD = "or a script without `if __name__ == '__main__':`, which every process runs again?"
#: Pieces handed to an executor of somebody else and not yet back.
IN_FLIGHT = 32


class WorkerDiedError(QpsafeError):
    """A process died twice while doing the same work."""


class Crew(Protocol):
    """Who takes pieces of work.

    Attributes:
        ahead: How many may be out at a time.
    """

    ahead: int

    def submit(self, work: Callable[..., Any], *arguments: Any) -> Future[Any]:
        """Take a piece of work."""

    def renew(self) -> None:
        """Be ready again after a process has died."""

    def close(self, at_once: bool) -> None:
        """Release everybody; at once: without waiting for unfinished work."""


class Alone:
    """This process."""

    ahead = 1

    def submit(self, work: Callable[..., Any], *arguments: Any) -> Future[Any]:
        """Do it now."""
        future: Future[Any] = Future()
        try:
            future.set_result(work(*arguments))
        except Exception as error:
            future.set_exception(error)
        return future

    def renew(self) -> None:
        """Nothing can have died."""

    def close(self, at_once: bool) -> None:
        """There is nobody to release."""


class Processes:
    """Processes of our own, started anew (not forked), which leave Ctrl-C to this one.

    Args:
        count: How many.
    """

    def __init__(self, count: int) -> None:
        self.count, self.ahead = count, 2 * count
        self._others = multiprocessing.active_children()
        self._pool = self._new()

    def _new(self) -> ProcessPoolExecutor:
        return ProcessPoolExecutor(self.count, multiprocessing.get_context("spawn"), _begin)

    def submit(self, work: Callable[..., Any], *arguments: Any) -> Future[Any]:
        """Hand it to a process."""
        with _interrupts_held():  # a process may be started now
            return self._pool.submit(work, *arguments)

    def renew(self) -> None:
        """Start new processes: when one of a pool dies, the rest are ended."""
        self._pool.shutdown(wait=True, cancel_futures=True)
        self._pool = self._new()

    def close(self, at_once: bool) -> None:
        """End the processes."""
        if at_once:
            for process in multiprocessing.active_children():
                if process not in self._others:
                    process.kill()  # they write nothing: nothing is left half done
        self._pool.shutdown(wait=True, cancel_futures=True)


class Given:
    """An executor of somebody else, who starts and ends it.

    Args:
        executor: Anything with `submit`, e.g. Dask's `Client.get_executor()`.
    """

    ahead = IN_FLIGHT

    def __init__(self, executor: Executor) -> None:
        self._executor = executor

    def submit(self, work: Callable[..., Any], *arguments: Any) -> Future[Any]:
        """Hand it to the executor."""
        return self._executor.submit(work, *arguments)

    def renew(self) -> None:
        """It is for its owner to replace processes, as Dask does."""

    def close(self, at_once: bool) -> None:
        """It goes on for its owner."""


@contextmanager
def crew_at_work(executor: Executor | None, workers: int) -> Iterator[Crew]:
    """Who plays: released at the end, and at once if that is an exception.

    Args:
        executor: Any of `concurrent.futures`, or Dask's; None for processes of our own.
        workers: Processes, if there is no executor; 1 for none but this one.
    """
    crew: Crew = Given(executor) if executor is not None else Processes(workers) if workers > 1 else Alone()
    good = False
    try:
        yield crew
        good = True
    finally:
        crew.close(at_once=not good)


@contextmanager
def _interrupts_held() -> Iterator[None]:
    """Ctrl-C waits meanwhile, and never reaches processes that are started in here: they inherit what is held."""
    if not hasattr(signal, "pthread_sigmask"):  # Windows
        yield
        return
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _begin() -> None:
    """Of a process: leave Ctrl-C to the parent, and end with it, even if it is killed."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    Thread(target=_end_with_parent, daemon=True).start()


def _end_with_parent() -> None:
    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)


def answers(
    crew: Crew,
    work: Callable[[Piece], Answer],
    pieces: Iterable[Piece],
    notice: Callable[[str], None] | None = None,
) -> Generator[Answer, None, None]:
    """Have all pieces done; answers come in any order.

    When a process dies, what was handed out is done once more, piece by piece: so that the fatal piece is known.

    Args:
        crew: Who does them.
        work: What to do with a piece; it must be possible to pickle both.
        pieces: In the order in which they are handed out.
        notice: Told in words when a process has died.

    Raises:
        WorkerDiedError: A process died of a piece that was the only one handed out, in its second trial.
    """
    todo, again = deque(pieces), deque[Piece]()
    out: dict[Future[Answer], tuple[Piece, bool]] = {}
    broken = False
    try:
        while todo or again or out:
            if again and not out:
                if broken:
                    crew.renew()
                    broken = False
                piece = again.popleft()
                out[_handed(crew, work, piece)] = piece, True
            while todo and not again and not broken and len(out) < crew.ahead:
                piece = todo.popleft()
                out[_handed(crew, work, piece)] = piece, False
            for future in wait(out, return_when=FIRST_COMPLETED).done:
                piece, alone = out.pop(future)
                died = future.exception()
                if died is None:
                    yield future.result()
                elif not _is_death(died):
                    raise died
                elif alone:
                    raise WorkerDiedError(
                        f"a process died twice of {piece} (out of memory? {_GUARD}): {died}"
                    ) from None
                else:
                    if not broken and notice is not None:
                        notice(f"a process died; what was handed out is done once more, one by one: {died}")
                    broken = True
                    again.append(piece)
    finally:
        for future in out:
            future.cancel()


def _handed(crew: Crew, work: Callable[[Piece], Answer], piece: Piece) -> Future[Answer]:
    """A piece handed out; where nobody is left to take it, as if they had died of it."""
    try:
        return crew.submit(work, piece)
    except BrokenExecutor as error:
        future: Future[Answer] = Future()
        future.set_exception(error)
        return future


def _is_death(error: BaseException) -> bool:
    return isinstance(error, BrokenExecutor) or type(error).__name__ == "KilledWorker"  # Dask's


@contextmanager
def dask_executor(address: str) -> Iterator[Executor]:
    """The executor of a Dask cluster.

    Args:
        address: Of its scheduler, such as ``tcp://192.168.0.7:8786``.

    Raises:
        MissingExtraError: `distributed` is not installed.
        ConfigurationError: Nobody answers there.
    """
    require("dask", "--dask", "distributed")
    from distributed import Client
    from distributed.comm import get_address_host

    try:
        get_address_host(address)  # a client that has refused its address takes half a minute to be forgotten
        client = Client(address, timeout=10, set_as_default=False)
    except (OSError, ValueError, TypeError) as error:
        raise ConfigurationError(
            "qpsafe campaign", "--dask", address, f"address of a Dask scheduler ({error})"
        ) from None
    try:
        yield client.get_executor()
    finally:
        with suppress(Exception):  # it may have gone first
            client.close()
