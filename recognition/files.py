"""Files that recognition makes itself and may make again."""

from __future__ import annotations

import hashlib
import tempfile
from pathlib import Path


def keep(content: bytes, path: Path) -> Path:
    """Write a file whole or not at all, also for those who write the same beside; nothing where it has that content already.

    Raises:
        OSError: the file can't be written.
    """
    if path.is_file() and path.read_bytes() == content:
        return path
    path.parent.mkdir(parents=True, exist_ok=True)
    with tempfile.NamedTemporaryFile(dir=path.parent, prefix=path.name, delete=False) as draft:
        draft.write(content)
    Path(draft.name).chmod(0o644)  # drafts are for their owner's eyes only
    return Path(draft.name).replace(path)


def digest(content: bytes) -> str:
    """A short name for some content, to tell files apart."""
    return hashlib.blake2b(content, digest_size=6).hexdigest()
