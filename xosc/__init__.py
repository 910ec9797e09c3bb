"""OpenSCENARIO XML documents of versions 1.0 to 1.3: reading, resolving and writing them."""

from xosc.distributions import ParameterSpace, sample, variations
from xosc.document import Document, load, write
from xosc.node import Node
from xosc.resolve import Resolved, resolve

__all__ = ["Document", "Node", "ParameterSpace", "Resolved", "load", "resolve", "sample", "variations", "write"]
