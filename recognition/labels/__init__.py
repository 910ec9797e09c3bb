"""Labels: which of the 17 classes of scenarios happen when in a recording, by the rules of
METHOD.md §2.

No label comes from anything but the recorded motion and the roles of the lanes it is on.

Modules:

- `changes`: lane changes and passages of junctions
- `critical`: critical moments of a recording, whatever its class
- `classes`: classes of scenarios, their events, and the thresholds of the rules that find them
- `labelling`: events of a recording by all rules, and ways through junctions
- `maneuvers`: manoeuvres and their parameters: names and ranges
- `rules`: rules of the 17 classes: lanes and other vehicles on roads
- `scene`: scene of a recording as the rules read it; hits of the rules and their precedence

Example::

    label(recording, site, "name")  # events of the 17 classes
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from schemas.common.packages import public

if TYPE_CHECKING:
    from recognition.labels.classes import Label as Label
    from recognition.labels.classes import LabelledEvent as LabelledEvent
    from recognition.labels.classes import Rules as Rules
    from recognition.labels.classes import counts as counts
    from recognition.labels.labelling import RULES as RULES
    from recognition.labels.labelling import JunctionWay as JunctionWay
    from recognition.labels.labelling import label as label
    from recognition.labels.labelling import passing as passing
else:
    __getattr__, __dir__ = public(
        __name__,
        {
            **dict.fromkeys(
                ("Label", "LabelledEvent", "Rules", "counts"), "recognition.labels.classes"
            ),
            **dict.fromkeys(
                ("RULES", "JunctionWay", "label", "passing"), "recognition.labels.labelling"
            ),
        },
    )

__all__ = ["RULES", "JunctionWay", "Label", "LabelledEvent", "Rules", "counts", "label", "passing"]
