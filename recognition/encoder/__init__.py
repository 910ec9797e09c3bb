"""The encoder: from occupancy grids to feature vectors (METHOD §1). Its modules need torch; this one does not."""
