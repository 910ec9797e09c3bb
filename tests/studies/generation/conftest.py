"""The search problem of `tests.generation`, which answers at once."""

from tests.generation.conftest import problem, realism

__all__ = ["problem", "realism"]
