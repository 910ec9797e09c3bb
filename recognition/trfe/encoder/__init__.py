"""The encoder: from occupancy grids to feature vectors (METHOD §1). Its modules need torch; this
one does not."""

import os

os.environ.setdefault(
    "OMP_WAIT_POLICY", "passive"
)  # where cores are shared, threads that wait busily slow torch down fourfold
