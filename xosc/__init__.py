"""OpenSCENARIO XML documents of versions 1.0 to 1.4: reading, resolving, varying
and writing them.
"""

from typing import TYPE_CHECKING

from schemas.common.packages import public
from xosc.document import Document, load, write
from xosc.document.node import Node
from xosc.resolve import Resolved, resolve

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
    from xosc.distributions import ParameterSpace as ParameterSpace
    from xosc.distributions import sample as sample
    from xosc.distributions import variations as variations
    from xosc.distributions import write_distribution as write_distribution
    from xosc.writing.versions import convert as convert

    __version__: str
else:
    __getattr__, __dir__ = public(
        __name__,
        {
            "ParameterSpace": "xosc.distributions",
            "convert": "xosc.writing.versions",
            "sample": "xosc.distributions",
            "variations": "xosc.distributions",
            "write_distribution": "xosc.distributions",
        },
    )
