"""Presets of the encoder that experiments compare: those of the product, and ablations of the smaller one."""

from __future__ import annotations

from dataclasses import replace

from recognition.encoder.config import PRESETS as PRODUCT
from recognition.encoder.config import Preset

_CPU = PRODUCT["cpu"]
PRESETS: dict[str, Preset] = {
    **PRODUCT,
    "cpu-cells": _CPU._replace(architecture=replace(_CPU.architecture, front="cells")),
    "cpu-rows": _CPU._replace(architecture=replace(_CPU.architecture, front="cells", tokens="rows")),
}
"""`cpu-cells` has no convolutions; `cpu-rows` has tokens of the grids flattened row by row besides, as published."""
