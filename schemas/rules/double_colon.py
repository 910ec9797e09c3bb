"""Names leave the separator of references alone."""

from collections.abc import Iterator

from schemas.checks.document import Document
from schemas.checks.registry import Finding, rule
from schemas.xml import local_name


@rule("asam.net:xosc:1.0.0:naming.no_double_colon_prefix_in_names")
def check(document: Document) -> Iterator[Finding]:
    """Names shall not contain `::`, which separates the names in a reference."""
    for element, _, name in document.values("name"):
        if "::" in name and not local_name(element).endswith(("Condition", "StateAction")):
            yield Finding(element, f"the name {name!r} contains '::'")
