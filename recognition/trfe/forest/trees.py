"""Decision trees as arrays: all nodes of a forest one tree after the other, without scikit-learn.

scikit-learn grows them; voting and comparing paths need the arrays alone.
"""

from __future__ import annotations

from typing import Any, NamedTuple, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from recognition.trfe.inputs.samples import UNKNOWN, matrix
from schemas.common.array_types import FloatArray, IntArray

_LEAF = -1
"""Child of a node without any"""
_BLOCK = 512
"""Samples that go down all trees at a time: their places stay in the processor's cache"""


class Trees(NamedTuple):
    """A forest of T trees with N nodes.

    Args:
        starts: number of the first node of each tree, and N (T + 1,).
        feature, threshold: of each node (N,): a sample goes left if its feature is not greater.
        left, right: numbers of the children (N,), greater than the node's; −1 for a leaf.
        choice: position among the classes that a leaf votes for (N,).
        classes: labels, ascending; none of trees that were grown without labels.
        width: number of features.
    """

    starts: IntArray
    feature: NDArray[Any]
    threshold: FloatArray
    left: NDArray[Any]
    right: NDArray[Any]
    choice: NDArray[Any]
    classes: IntArray
    width: int

    @classmethod
    def of(cls, grown: Any) -> Self:
        """The trees of a fitted forest of scikit-learn."""
        nodes = [tree.tree_ for tree in grown.estimators_]
        starts = np.cumsum([0, *(tree.node_count for tree in nodes)])
        # scikit-learn numbers the nodes of each tree from 0.
        left, right = (
            np.concatenate(
                [
                    np.where(child < 0, _LEAF, child + start)
                    for child, start in zip(
                        (getattr(tree, name) for tree in nodes), starts[:-1].tolist(), strict=True
                    )
                ]
            ).astype(np.int32)
            for name in ("children_left", "children_right")
        )
        inner = left != _LEAF
        feature = np.concatenate([tree.feature for tree in nodes])
        classes = np.asarray(getattr(grown, "classes_", np.zeros(0)), np.int64)
        choice = np.concatenate([tree.value[:, 0].argmax(axis=1) for tree in nodes])
        return cls(
            starts,
            np.where(inner, feature, 0).astype(np.int32),
            np.where(inner, np.concatenate([tree.threshold for tree in nodes]), 0.0),
            left,
            right,
            choice.astype(np.int32),
            classes,
            int(grown.n_features_in_),
        )

    @classmethod
    def read(cls, arrays: dict[str, NDArray[Any]]) -> Self:
        """From the arrays of `arrays`.

        Raises:
            ValueError: they are no trees: paths must end at leaves, and features, children and
                choices be there.
            KeyError: one is missing.
        """
        names = cls._fields
        if set(arrays) != set(names):
            raise KeyError(min(set(arrays) ^ set(names)))
        whole = {name: np.asarray(arrays[name]) for name in names}
        for name, values in whole.items():
            kind = np.floating if name == "threshold" else np.integer
            if not np.issubdtype(values.dtype, kind) or values.ndim != (
                0 if name == "width" else 1
            ):
                raise ValueError(f"{name} of its trees is no list of numbers")
        width = int(whole.pop("width"))
        numbers: Any = {
            name: values.astype(np.float64 if name == "threshold" else np.int64)
            for name, values in whole.items()
        }
        # Checked in 64 bits and narrowed afterwards: no number of a file wraps round.
        found = cls(**numbers, width=width)
        found._check()
        small = {name: getattr(found, name).astype(np.int32) for name in _NODES}
        return found._replace(**small)

    def arrays(self) -> dict[str, NDArray[Any]]:
        """As arrays by name, for a file, in the smallest types that hold them."""
        return {
            name: np.asarray(values) if name == "threshold" else _smallest(np.asarray(values))
            for name, values in self._asdict().items()
        }

    def _check(self) -> None:
        count, number = len(self.feature), np.arange(len(self.feature))
        starts, classes = self.starts, self.classes
        sound = (
            len(starts) > 1
            and starts[0] == 0
            and starts[-1] == count
            and (np.diff(starts) > 0).all()
            and self.width > 0
            and len(classes) > 0
            and (np.diff(classes) > 0).all()
            and classes[0] >= UNKNOWN
            and all(len(getattr(self, name)) == count for name in (*_NODES, "threshold"))
        )
        if not sound:
            raise ValueError("its trees are broken")
        end = np.repeat(starts[1:], np.diff(starts))
        inner = self.left != _LEAF
        # Children come after their parents, so that every path ends.
        sound = (
            (inner == (self.right != _LEAF)).all()
            and all(
                ((child > number) & (child < end))[inner].all() for child in (self.left, self.right)
            )
            and ((self.feature >= 0) & (self.feature < self.width)).all()
            and ((self.choice >= 0) & (self.choice < len(classes))).all()
            and np.isfinite(self.threshold).all()
        )
        if not sound:
            raise ValueError("one of its trees is broken")

    @property
    def count_of_trees(self) -> int:
        """Number of trees."""
        return len(self.starts) - 1

    def leaves(self, features: ArrayLike) -> IntArray:
        """Leaf (n, T) of each tree that samples (n, d) reach.

        Raises:
            UsageError: features that are not finite, or not of the dimension of the trees.
        """
        table = matrix(features, self.width)
        parts = [
            self._down(table[start : start + _BLOCK])
            for start in range(0, max(len(table), 1), _BLOCK)
        ]
        return np.concatenate(parts)

    def _down(self, table: NDArray[np.float32]) -> IntArray:
        trees = self.count_of_trees
        place = np.tile(self.starts[:-1], len(table))
        row = np.repeat(np.arange(len(table)) * self.width, trees)
        values = table.ravel()
        # Those that have not reached a leaf yet: paths differ in length by a factor.
        going = np.flatnonzero(self.left[place] != _LEAF)
        while len(going):
            node = place[going]
            # As in scikit-learn, float32 features against float64 thresholds: rounding one would
            # move samples to another leaf.
            below = values[row[going] + self.feature[node]] <= self.threshold[node]
            node = np.where(below, self.left[node], self.right[node])
            place[going] = node
            going = going[self.left[node] != _LEAF]
        return place.reshape(len(table), trees)

    def votes(self, features: ArrayLike) -> IntArray:
        """Votes (n, K) for samples (n, d); the columns are the classes but `UNKNOWN`, ascending.

        A row adds up to the number of trees, less those that vote for the background.

        Raises:
            UsageError: features that are not finite, or not of the dimension of the trees.
        """
        # Hard votes of trees: their spread over classes is a feature, which
        # mean probabilities blur.
        chosen = self.choice[self.leaves(features)]
        known = np.flatnonzero(self.classes != UNKNOWN)
        return np.stack([(chosen == one).sum(axis=1) for one in known], axis=1, dtype=np.int64)

    def overlap(self, tree: int, leaves: IntArray) -> NDArray[np.float32]:
        """Shared part (L, L) of the paths to leaves (L,) of a tree: their common nodes over all
        nodes of both."""
        start, end = self.starts[tree : tree + 2].tolist()
        parent = np.full(end - start, _LEAF)
        inner = np.flatnonzero(self.left[start:end] != _LEAF)
        for child in (self.left, self.right):
            parent[child[start:end][inner] - start] = inner
        path = np.zeros((len(leaves), end - start), np.float32)
        rows, place = np.arange(len(leaves)), leaves - start
        while len(rows):
            path[rows, place] = 1.0
            place = parent[place]
            rows, place = rows[place != _LEAF], place[place != _LEAF]
        common = path @ path.T
        length = common.diagonal()
        return np.asarray(common / (length[:, None] + length[None, :] - common), np.float32)


def _smallest(values: NDArray[Any]) -> NDArray[Any]:
    kinds = (np.int8, np.int16, np.int32, np.int64)
    low, high = int(values.min(initial=0)), int(values.max(initial=0))
    return values.astype(
        next(kind for kind in kinds if np.iinfo(kind).min <= low and high <= np.iinfo(kind).max)
    )


_NODES = ("feature", "left", "right", "choice")
