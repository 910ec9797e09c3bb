"""How many clusters samples likely form."""

from __future__ import annotations

from sklearn.cluster import KMeans
from sklearn.metrics import silhouette_score

from recognition.samples import Features


def likely_count(features: Features, most: int, seed: int) -> int:
    """The number of clusters, from 2 to `most`, at which k-means of features (n, d) has the greatest silhouette.

    Source: Rousseeuw, "Silhouettes" (Journal of Computational and Applied Mathematics 20, 1987).
    """
    counts = range(2, min(most, len(features) - 1) + 1)
    of_count = {
        count: silhouette_score(features, KMeans(count, n_init=5, random_state=seed).fit_predict(features)) for count in counts
    }
    return max(of_count, key=lambda count: of_count[count], default=1)
