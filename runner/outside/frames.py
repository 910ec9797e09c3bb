"""Frames over a socket: 4 bytes with the length (unsigned, the highest first), then so many bytes; each in a limited time."""

from __future__ import annotations

import hmac
import json
import selectors
import socket
import struct
import time

from schemas.common.errors import ToolchainError, UsageError

_LENGTH = struct.Struct(">I")
LONGEST = 65_536
"""Bytes that a frame of a client may have"""
_LONGEST_HELLO = 1024
"""Bytes that the frame with the token may have"""
_OPEN = 16
"""Connections that may be open until one of them has sent the token"""


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


def accept(host: str, port: int, wait: float, limit: float, token: str) -> Frames:
    """Listen until a client has connected and sent a frame with `{"token": …}`; others are turned away, further ones refused.

    Any number of connections may be open meanwhile, so that one which sends nothing, or slowly, is in no one's way.

    Args:
        wait: time (s) in which it has to connect and send the token.
        limit: time (s) for each frame.
        token: what it has to know.

    Raises:
        UsageError: the address can't be listened at.
        ToolchainError: no client with the token connects.
    """
    try:
        listener = socket.create_server((host, port), backlog=_OPEN)
    except OSError as error:
        raise UsageError(f"the bridge can't listen at {host}:{port}: {error.strerror or error}") from None
    turned_away = 0
    with listener, selectors.DefaultSelector() as selector:
        listener.setblocking(False)
        selector.register(listener, selectors.EVENT_READ)
        waiting: dict[socket.socket, bytes] = {}
        end = time.monotonic() + wait
        try:
            while (left := end - time.monotonic()) > 0.0:
                for key, _ in selector.select(left):
                    connection = key.fileobj
                    assert isinstance(connection, socket.socket)
                    if connection is listener:
                        turned_away += _admit(listener, selector, waiting)
                        continue
                    known = _hear(connection, waiting, token)
                    if known is not None:
                        selector.unregister(connection)
                        del waiting[connection]
                        if known:
                            return Frames(connection, limit)
                        connection.close()
                        turned_away += 1
        finally:
            for connection in waiting:
                connection.close()
    strangers = f"; {turned_away + len(waiting)} without its token were turned away" if turned_away or waiting else ""
    raise ToolchainError(f"no client has connected to the bridge at {host}:{port} within {wait:g} s{strangers}")


def _admit(listener: socket.socket, selector: selectors.BaseSelector, waiting: dict[socket.socket, bytes]) -> int:
    """Take a connection in; the number of those that make room for it, which have been silent for longest."""
    try:
        connection, _ = listener.accept()
    except OSError:  # it has gone already
        return 0
    connection.setblocking(False)
    selector.register(connection, selectors.EVENT_READ)
    waiting[connection] = b""
    if len(waiting) <= _OPEN:
        return 0
    oldest = next(iter(waiting))
    selector.unregister(oldest)
    del waiting[oldest]
    oldest.close()
    return 1


def _hear(connection: socket.socket, waiting: dict[socket.socket, bytes], token: str) -> bool | None:
    """Whether a connection has sent the token; None while its frame is not complete."""
    missing = _LENGTH.size - len(waiting[connection])
    if missing <= 0:
        (length,) = _LENGTH.unpack(waiting[connection][: _LENGTH.size])
        if length > _LONGEST_HELLO:
            return False
        missing = length + _LENGTH.size - len(waiting[connection])
    try:
        more = connection.recv(missing) if missing > 0 else b""
    except BlockingIOError:
        return None
    except OSError:
        return False
    if not more and missing > 0:
        return False
    waiting[connection] += more
    data = waiting[connection]
    if len(data) < _LENGTH.size:
        return None
    (length,) = _LENGTH.unpack(data[: _LENGTH.size])
    if length > _LONGEST_HELLO:
        return False
    return None if len(data) < _LENGTH.size + length else _knows(data[_LENGTH.size :], token)


def _knows(body: bytes, token: str) -> bool:
    try:
        said = json.loads(body)
    except (ValueError, RecursionError):
        return False
    given = said.get("token") if isinstance(said, dict) else None
    return isinstance(given, str) and hmac.compare_digest(given.encode(errors="replace"), token.encode(errors="replace"))
