"""Ranges and weights of distributions make sense."""

from collections.abc import Iterator

from schemas.checks.document import Document
from schemas.checks.messages import negative
from schemas.checks.registry import Finding, rule

_WEIGHTS = (
    ("Element", "weight"),
    ("Bin", "weight"),
    ("NormalDistribution", "variance"),
    ("LogNormalDistribution", "variance"),
    ("PoissonDistribution", "expectedValue"),
)


@rule("xosc.toolchain:xosc:1.1.0:data_type.distributions_are_well_formed", kinds=("distribution",), since=(1, 1))
def check(document: Document) -> Iterator[Finding]:
    """Limits of ranges must ascend, step widths be positive, and weights, variances and expected counts not negative."""
    for element in document.elements("Range"):
        lower, upper = document.number(element, "lowerLimit"), document.number(element, "upperLimit")
        if lower is not None and upper is not None and not lower <= upper:
            yield Finding(element, f"the lower limit {lower:g} is greater than the upper limit {upper:g}")
    for element in document.elements("DistributionRange"):
        step = document.number(element, "stepWidth")
        if step is not None and not step > 0:
            yield Finding(element, f"stepWidth={step:g} must be greater than 0")
    yield from negative(document, _WEIGHTS)
