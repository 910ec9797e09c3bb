"""What all encoders have: windows of a view to one feature vector, and from there to classes."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Sequence

from torch import Tensor, nn

from recognition.encoder.config import Sizes
from recognition.training.views import View
from schemas.errors import UsageError


class Encoder(nn.Module):
    """A transformer with a class head once it has been fine-tuned.

    Args:
        architecture: its sizes.
        view: of the windows that it reads.
    """

    architecture: Sizes
    view: View

    def __init__(self, architecture: Sizes, view: View) -> None:
        super().__init__()
        self.architecture, self.view = architecture, view
        self.norm = nn.LayerNorm(architecture.dim)
        self.classes: tuple[int, ...] = ()
        self.head: nn.Linear | None = None

    def set_classes(self, classes: Sequence[int]) -> None:
        """Give it a new, untrained class head for labels, ascending; none for none."""
        self.classes = tuple(classes)
        if classes:
            self.head = nn.Linear(self.architecture.dim, len(self.classes), device=self.norm.weight.device)

    @abstractmethod
    def forward(self, windows: Tensor) -> Tensor:
        """Features (n, dim) of windows (n, ...).

        Raises:
            UsageError: the windows have another shape than the view's.
        """

    @abstractmethod
    def augmented(self, windows: Tensor) -> Tensor:
        """Windows with changes that leave their classes as they are."""

    def logits(self, windows: Tensor) -> Tensor:
        """Logits (n, classes) of windows.

        Raises:
            UsageError: the encoder has not been fine-tuned to any classes.
        """
        if self.head is None:
            raise UsageError("this encoder has no class head: fine-tune it")
        return self.head(self(windows))

    def require_shape(self, windows: Tensor) -> None:
        """Refuse windows of another shape than the view's."""
        if windows.shape[1:] != self.view.shape:
            raise UsageError(f"the encoder reads windows of shape {self.view.shape}, not {tuple(windows.shape[1:])}")
