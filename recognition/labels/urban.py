"""Rules 9 and 10: others cut in and out before an ego on urban lanes, along the lane however it winds."""

from __future__ import annotations

import numpy as np

from recognition.labels import cuts
from recognition.labels.classes import Label
from recognition.labels.hits import Hits
from recognition.labels.scene.scene import Scene
from recognition.sites import Role

_ROUNDING = 0.01
"""Files round speed limits by less than this, m/s."""


def urban_cut_in(scene: Scene) -> Hits:
    """9: another vehicle comes into ego's lane and becomes its lead, with 0 < TTC < `rules.urban_ttc` soon after."""
    found = _on_urban(scene, cuts.cut_ins(scene))
    ttc = cuts.least_ttc(scene, found)
    critical = (ttc > 0.0) & (ttc < scene.rules.urban_ttc)
    found, ttc = found.where(critical), ttc[critical]
    near = cuts.lateral_gap(scene, found) < scene.rules.lateral_gap
    return Hits(Label.URBAN_CUT_IN, found.ego, found.other, {"gap": found.gap, "ttc": ttc, "lateral_gap_below_2m": near})


def urban_cut_out(scene: Scene) -> Hits:
    """10: ego's lead leaves the lane."""
    found = _on_urban(scene, cuts.cut_outs(scene))
    return Hits(Label.URBAN_CUT_OUT, found.ego, found.other, {"gap": found.gap, "ego_brakes": cuts.brakes(scene, found)})


def _on_urban(scene: Scene, found: cuts.Cuts) -> cuts.Cuts:
    """Those on urban lanes whose limit is low, or not known."""
    limit = scene.site.lanes.speed_limit[scene.strip[found.ego]]
    slow = (limit <= scene.rules.urban_speed_limit + _ROUNDING) | np.isinf(limit)
    return found.where(scene.has_role(Role.URBAN, Role.APPROACH)[found.ego] & slow)
