"""What the ego is called in scenarios that do not say which entity it is."""

from __future__ import annotations

import re

EGO_NAME = re.compile(r"(ego|hero)([-_ ]?(vehicle|car))?[-_ ]?\d*", re.IGNORECASE)
"""Names of vehicles that are meant as the ego."""
