"""Kinds of things that register themselves by being in a module of a folder: rules, actions, data sets, exports, baselines, …

A new kind is one new file; no list anywhere names it. A folder of kinds is used in one of two ways:

- **The kinds register something** when they are imported (`@rule(…)`, `@action(…)`). Code that needs all of them calls
  `load("schemas.rules")` once, before it reads the table that they fill.
- **A kind is chosen by its name.** Its module holds one function or class with the name that the folder agrees on, and says
  in a constant what people read of it:

      # runner/exports/osi.py
      SUMMARY = "ASAM OSI ground-truth traces, .osi and .mcap"
      def export(result, name, folder): …

  `described("runner.exports", "SUMMARY")` is then `{"osi": "ASAM OSI …", …}` without importing any of them, so that help and
  errors can list what there is before libraries such as torch are loaded; `import_module(f"runner.exports.{name}")` loads the
  one that was chosen. A module without the constant is a helper and no kind. Where more is to be known of a kind, the
  constant is a tuple or dict of literals.

Modules (and packages) come in the order of their names, whatever the file system says; those whose name begins with an
underscore are helpers too. Source trees, installed wheels and zip files work alike.
"""

from __future__ import annotations

import ast
from functools import cache
from importlib import import_module
from importlib.util import find_spec
from pkgutil import iter_modules
from types import ModuleType
from typing import Any


@cache
def names(package: str) -> tuple[str, ...]:
    """Names of a package's modules, sorted, without the package's own; none of them is imported.

    Args:
        package: its full name; it is imported itself, so its `__init__` is to be light.
    """
    found = (module.name for module in iter_modules(import_module(package).__path__))
    return tuple(sorted(name for name in found if not name.startswith("_")))


def load(package: str) -> list[ModuleType]:
    """Import all modules of a package, in the order of `names`."""
    return [import_module(f"{package}.{name}") for name in names(package)]


@cache
def described(package: str, constant: str) -> dict[str, Any]:
    """Return the values of a constant in a package's modules, by module name. No module is imported.

    Args:
        package: its full name.
        constant: name that those modules which are kinds assign a literal to; the others are left out.

    Raises:
        ValueError: a module assigns something else than a literal (numbers, texts, None, and tuples, dicts, … of them).
    """
    found = {name: _constant(f"{package}.{name}", constant) for name in names(package)}
    return {name: ast.literal_eval(value) for name, value in found.items() if value is not None}


def _constant(module: str, constant: str) -> ast.expr | None:
    """The expression that a module assigns to a name at its top level; None where it does not."""
    spec = find_spec(module)
    source = spec.loader.get_source(module) if spec and spec.loader and hasattr(spec.loader, "get_source") else None
    for statement in ast.parse(source or "").body:
        if isinstance(statement, ast.Assign):
            targets: list[ast.expr] = statement.targets
        elif isinstance(statement, ast.AnnAssign):
            targets = [statement.target]
        else:
            continue
        if any(isinstance(target, ast.Name) and target.id == constant for target in targets):
            return statement.value
    return None
