"""Variants of TRFE: its ablations, other screenings, and the options that the paper discusses."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

from recognition.trfe.config import Config, Steps
from recognition.trfe.discovery.candidates import Preprocessing, Promotion
from recognition.trfe.forest.known import DELTA
from recognition.trfe.forest.screening import EvtScreening
from recognition.trfe.trfe import TRFE
from studies.recognition import kinds, strategies
from studies.recognition.learning import Learns
from studies.recognition.recalibrated import Recalibrated

CHAINED = (
    "trfe",
    "as-published",
    "no-ucs",
    "nvp",
    "no-oc",
    "k-means",
    "joint",
    "retrained",
    "joint-retrained",
    "as-published-joint",
)
"""Variants that are also followed through all rounds on their own discoveries."""
CAPACITIES = (125, 250, 500, 1000)
"""Values of W for its sensitivity; `w125` and so on are variants too."""
SIFTED = Preprocessing(spread=3.0, margin=0.75)
"""New-value preprocessing (NVP) that sets outliers and what is near known classes aside. At a
margin of 1, which the source has, half of the unknown samples would be."""
PUBLISHED_NVP = replace(SIFTED, margin=1.0)
PUBLISHED_PROMOTION = Promotion(relative_cohesion=0.85, margin=1.0)
"""Both steps with the margins of the publication; its cohesion of 0.85 counts
from that of the known classes
"""


@dataclass(frozen=True)
class Variant:
    """TRFE with other settings, steps or behaviour.

    Attributes:
        title: name of its row in the report.
        config, steps, model: settings, steps and class.
        learns: what trains the encoder on; None keeps it as it is.
    """

    title: str
    config: Config = field(default_factory=Config)
    steps: Steps = field(default_factory=Steps)
    model: type[TRFE] = TRFE
    learns: Learns | None = None


def _screened(name: str, title: str) -> Variant:
    """The variant with another screening; only the δ of `EvtScreening` is chosen."""
    module = kinds.kind(kinds.SCREENINGS, name)
    chosen = isinstance(module.SCREENING, type) and issubclass(module.SCREENING, EvtScreening)
    steps = Steps(screening=module.SCREENING)
    if module.PLAIN_VOTES:
        steps = Steps(screening=module.SCREENING, grow=strategies.grow_plain)
    return Variant(title, Config(delta=None if chosen else DELTA), steps)


_AS_PUBLISHED = Variant(
    "as published",
    Config(preprocessing=PUBLISHED_NVP, promotion=PUBLISHED_PROMOTION),
    Steps(
        grow=strategies.grow_plain,
        screening=kinds.kind(kinds.SCREENINGS, "reading-a").SCREENING,
        cluster=strategies.all_candidates,
    ),
)
VARIANTS: dict[str, Variant] = {
    "trfe": Variant("**TRFE**"),
    "no-ucs": Variant("No-UCS", Config(delta=DELTA), model=strategies.Unscreened),
    "nvp": Variant("with NVP", Config(preprocessing=SIFTED)),
    "no-oc": Variant("No-OC", steps=Steps(cluster=strategies.average_linkage)),
    "k-means": Variant("k-means in place of heads", steps=Steps(cluster=strategies.k_means)),
    "strict": Variant(
        "margins of the publication",
        Config(preprocessing=PUBLISHED_NVP, promotion=PUBLISHED_PROMOTION),
    ),
    "as-published": _AS_PUBLISHED,
    "as-published-joint": replace(
        _AS_PUBLISHED,
        title="as published, encoder trained jointly and again",
        learns=Learns(jointly=True, again=True, all_candidates=True),
    ),
    "joint": Variant("encoder trained with the heads", learns=Learns(jointly=True)),
    "retrained": Variant("encoder trained again after promotion", learns=Learns(again=True)),
    "joint-retrained": Variant(
        "encoder trained with the heads and again", learns=Learns(jointly=True, again=True)
    ),
    **{name: _screened(name, title) for name, title in kinds.titles(kinds.SCREENINGS).items()},
    "recalibrated": Variant("threshold recalibrated", steps=Steps(screening=Recalibrated)),
    "euclidean": Variant(
        "Euclidean metric", steps=Steps(prototypes=strategies.EuclideanPrototypes.fit)
    ),
    "cosine": Variant("cosine metric", steps=Steps(prototypes=strategies.CosinePrototypes.fit)),
    "margin": Variant(
        "nearest-prototype margin", steps=Steps(prototypes=strategies.MarginPrototypes.fit)
    ),
    "soft-targets": Variant("soft pair targets", steps=Steps(cluster=strategies.soft_targets)),
    "all-candidates": Variant(
        "all candidates offered", steps=Steps(cluster=strategies.all_candidates)
    ),
    "supervised-forest": Variant(
        "supervised forest", steps=Steps(similarity=strategies.supervised_similarity)
    ),
    "refreshed-forest": Variant(
        "unsupervised forest, refreshed", steps=Steps(cluster=strategies.refreshed_forest)
    ),
    **{
        f"w{size}": Variant(f"W = {size}", Config(preprocessing=Preprocessing(capacity=size)))
        for size in CAPACITIES
    },
}
"""Variants by name."""
