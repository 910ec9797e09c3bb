"""Frames over a socket: 4 bytes with the length (unsigned, big-endian), then the content.

Each frame is sent and received as a whole in a limited time. The bridge and the boundary of systems
under test use them.
"""

from __future__ import annotations

import socket
import struct
import time

from schemas.common.errors import ToolchainError

LENGTH = struct.Struct(">I")
LONGEST = 65_536
"""Bytes that a frame of a client may have"""
_CHUNK = 65_536


class PeerSilent(ToolchainError):
    """The other side has not sent, or not read, a whole frame in time."""


class PeerGone(ToolchainError):
    """The other side has closed the connection."""


class FrameConnection:
    """A connection with one peer.

    Args:
        connection: the socket, which is owned by this object.
        limit: time (s) in which a frame has to be sent or received as a whole; None for no limit.
        peer: noun for the other side, in messages.
        longest: bytes that a received frame may have.
    """

    def __init__(
        self, connection: socket.socket, limit: float | None, peer: str, longest: int = LONGEST
    ) -> None:
        self._connection, self.limit, self._peer, self._longest = connection, limit, peer, longest
        self._received = bytearray()
        # Small frames to and fro: Nagle's algorithm would hold each of them back.
        if connection.family in (socket.AF_INET, getattr(socket, "AF_INET6", None)):
            connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)

    def send(self, body: bytes) -> None:
        """Send a frame.

        Raises:
            PeerSilent: the peer does not read.
            PeerGone: it has closed the connection.
        """
        # `sendall` counts the limit for the whole frame.
        self._connection.settimeout(self.limit)
        try:
            self._connection.sendall(LENGTH.pack(len(body)) + body)
        except TimeoutError:
            raise PeerSilent(f"{self._peer} has read nothing for {self.limit:g} s") from None
        except OSError as error:
            raise self._gone(error) from None

    def receive(self, limit: float | None = None) -> bytes:
        """The next frame.

        Args:
            limit: time (s) for this frame, where it differs. What has arrived of a frame by then is
                kept for the next call.

        Raises:
            PeerSilent: none arrives in time.
            PeerGone: the peer has closed the connection.
            ToolchainError: the frame is too long.
        """
        limit = self.limit if limit is None else limit
        end = None if limit is None else time.monotonic() + limit
        received = self._received
        self._fill(LENGTH.size, end)
        (length,) = LENGTH.unpack_from(received)
        # Before it is received: a wrong length must not fill the memory.
        if length > self._longest:
            raise ToolchainError(
                f"{self._peer} sends a frame of {length} bytes, at most "
                f"{self._longest} are expected"
            )
        stop = LENGTH.size + length
        self._fill(stop, end)
        body = bytes(received[LENGTH.size : stop])
        del received[:stop]
        return body

    def _fill(self, count: int, end: float | None) -> None:
        """Receive a number of bytes, by a time of the monotonic clock (s)."""
        while len(self._received) < count:
            left = None if end is None else end - time.monotonic()
            try:
                # A timeout of 0 would mean a socket that does not block.
                if left is not None and left <= 0.0:
                    raise TimeoutError
                self._connection.settimeout(left)
                more = self._connection.recv(_CHUNK)
            except TimeoutError:
                raise PeerSilent(f"{self._peer} has not answered within {self.limit:g} s") from None
            except OSError as error:
                raise self._gone(error) from None
            if not more:
                raise self._gone()
            self._received += more

    def close(self) -> None:
        """End the connection."""
        self._connection.close()

    def _gone(self, error: OSError | None = None) -> PeerGone:
        why = f": {error.strerror}" if error is not None and error.strerror else ""
        return PeerGone(f"{self._peer} has closed the connection{why}")
