"""What several baselines and ablations are made of."""
