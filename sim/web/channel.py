"""One way from one process to another: a pipe, into which one end only writes and out of which the other only reads.

The writer never waits. A message that does not fit at the moment is dropped, so messages are complete states: the
next one supersedes the last. A pipe has a direction: nothing that the reader does can be read at the writer's end.
"""

from __future__ import annotations

import os
import pickle
import select
import struct
from multiprocessing import Pipe
from multiprocessing.connection import Connection
from typing import Any

_LENGTH = struct.Struct("<I")
READ = 1 << 16


class Outbound:
    """The end that writes.

    Args:
        connection: The writable end of a pipe; it is made not to block.

    Attributes:
        left_out: How many messages were dropped, for want of room or of a reader.
        closed: Whether the reader has gone.
    """

    def __init__(self, connection: Connection) -> None:
        self._connection = connection
        os.set_blocking(connection.fileno(), False)
        self._rest = memoryview(b"")  # of a message that has been begun
        self.left_out, self.closed = 0, False

    def offer(self, message: object) -> bool:
        """Send a message, if there is room now; never waits. Returns whether it is on its way."""
        if not self._push():
            self.left_out += 1
            return False
        data = pickle.dumps(message, pickle.HIGHEST_PROTOCOL)
        self._rest = memoryview(_LENGTH.pack(len(data)) + data)
        self._push()
        return not self.closed

    def _push(self) -> bool:
        """Write what has been begun; returns whether nothing is left of it."""
        try:
            while self._rest and not self.closed:
                self._rest = self._rest[os.write(self.fileno(), self._rest) :]
        except BlockingIOError:
            pass
        except OSError:  # nobody reads any more
            self.closed = True
        return not (self._rest or self.closed)

    def fileno(self) -> int:
        """Number of the descriptor, which can only be written to."""
        return self._connection.fileno()

    def close(self) -> None:
        """Say that nothing more comes."""
        self.closed = True
        self._connection.close()


class Inbound:
    """The end that reads.

    Args:
        connection: The readable end of a pipe.

    Attributes:
        closed: Whether the writer has gone.
    """

    def __init__(self, connection: Connection) -> None:
        self._connection = connection
        self._data = bytearray()
        self.closed = False

    def received(self, patience: float = 0.0) -> list[Any]:
        """All messages that have arrived, in order.

        Args:
            patience: How long to wait if there are none [s].
        """
        descriptor = self._connection.fileno()
        while not self.closed and select.select([descriptor], [], [], patience)[0]:
            piece = os.read(descriptor, READ)
            self._data += piece
            self.closed, patience = not piece, 0.0
        return self._cut()

    def _cut(self) -> list[Any]:
        found, at, whole = [], 0, len(self._data)
        while at + _LENGTH.size <= whole:
            end = at + _LENGTH.size + _LENGTH.unpack_from(self._data, at)[0]
            if end > whole:
                break
            found.append(pickle.loads(self._data[at + _LENGTH.size : end]))
            at = end
        del self._data[:at]
        return found

    def close(self) -> None:
        """Read no more."""
        self.closed = True
        self._connection.close()


def one_way() -> tuple[Connection, Connection]:
    """The readable and the writable end of a new pipe, to be handed to a process or made `Inbound` and `Outbound`."""
    return Pipe(duplex=False)
