"""OpenSCENARIO XML documents of versions 1.0 to 1.3: reading, resolving, varying and writing them."""

from typing import TYPE_CHECKING

from schemas.packages import public
from xosc.distributions import ParameterSpace, sample, variations, write_distribution
from xosc.document import Document, load, write
from xosc.node import Node
from xosc.resolve import Resolved, resolve
from xosc.versions import convert

__all__ = [
    "Document",
    "Node",
    "ParameterSpace",
    "Resolved",
    "convert",
    "load",
    "resolve",
    "sample",
    "variations",
    "write",
    "write_distribution",
]

if TYPE_CHECKING:
    __version__: str
else:
    __getattr__, __dir__ = public(__name__, {})
