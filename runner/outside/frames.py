"""Frames over a socket: 4 bytes with the length (unsigned, the highest first), then so many bytes; each in a limited time."""

from __future__ import annotations

import socket
import struct
import time

from schemas.errors import ToolchainError, UsageError

_LENGTH = struct.Struct(">I")
LONGEST = 65_536
"""Bytes that a frame of a client may have"""


class Frames:
    """A connection with one client.

    Args:
        connection: the socket, which is owned by this object.
        limit: time (s) in which a frame has to be sent or received as a whole.
    """

    def __init__(self, connection: socket.socket, limit: float) -> None:
        self._connection, self._limit = connection, limit
        connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)

    def send(self, body: bytes) -> None:
        """Send a frame.

        Raises:
            ToolchainError: the client does not read, or has gone.
        """
        self._connection.settimeout(self._limit)
        try:
            self._connection.sendall(_LENGTH.pack(len(body)) + body)
        except TimeoutError:
            raise ToolchainError(f"the client of the bridge has read nothing for {self._limit:g} s") from None
        except OSError as error:
            raise _gone(error) from None

    def receive(self) -> bytes:
        """The next frame.

        Raises:
            ToolchainError: none comes in time, it is too long, or the client has gone.
        """
        end = time.monotonic() + self._limit
        (length,) = _LENGTH.unpack(self._exactly(_LENGTH.size, end))
        if length > LONGEST:
            raise ToolchainError(f"the client of the bridge sends a frame of {length} bytes, at most {LONGEST} are expected")
        return self._exactly(length, end)

    def _exactly(self, count: int, end: float) -> bytes:
        """So many bytes, by a time of the monotonic clock (s)."""
        data = b""
        while len(data) < count:
            left = end - time.monotonic()
            try:
                if left <= 0.0:
                    raise TimeoutError
                self._connection.settimeout(left)
                more = self._connection.recv(count - len(data))
            except TimeoutError:
                raise ToolchainError(f"the client of the bridge has not answered within {self._limit:g} s") from None
            except OSError as error:
                raise _gone(error) from None
            if not more:
                raise _gone()
            data += more
        return data

    def close(self) -> None:
        """End the connection."""
        self._connection.close()


def _gone(error: OSError | None = None) -> ToolchainError:
    why = f": {error.strerror}" if error is not None and error.strerror else ""
    return ToolchainError(f"the client of the bridge has closed the connection{why}")


def accept(host: str, port: int, wait: float, limit: float) -> Frames:
    """Listen until one client has connected; further ones are refused.

    Args:
        wait: time (s) in which it has to connect.
        limit: time (s) for each frame.

    Raises:
        UsageError: the address can't be listened at.
        ToolchainError: no client connects.
    """
    try:
        listener = socket.create_server((host, port), backlog=1)
    except OSError as error:
        raise UsageError(f"the bridge can't listen at {host}:{port}: {error.strerror or error}") from None
    with listener:
        listener.settimeout(wait)
        try:
            connection, _ = listener.accept()
        except TimeoutError:
            raise ToolchainError(f"no client has connected to the bridge at {host}:{port} within {wait:g} s") from None
    return Frames(connection, limit)
