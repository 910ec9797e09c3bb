"""Files that the toolchain makes itself and reads again: written whole or not at all."""

from __future__ import annotations

import hashlib
import secrets
from pathlib import Path


def keep(content: bytes, path: Path) -> Path:
    """Write a file whole or not at all, also for those who write the same beside; nothing where it has that content already.

    It gets the permissions that the user's umask leaves to a new file.

    Raises:
        OSError: the file can't be written.
    """
    if path.is_file() and path.read_bytes() == content:
        return path
    path.parent.mkdir(parents=True, exist_ok=True)
    draft = path.with_name(f"{path.name}.{secrets.token_hex(4)}")  # what tempfile makes is for its owner's eyes only
    try:
        draft.write_bytes(content)
        return draft.replace(path)
    finally:
        draft.unlink(missing_ok=True)


def digest(content: bytes) -> str:
    """A short name for some content, to tell files apart."""
    return hashlib.blake2b(content, digest_size=6).hexdigest()
