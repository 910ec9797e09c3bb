"""Clustering methods for samples of unknown classes (`pool.ClusteringMethod`)."""
