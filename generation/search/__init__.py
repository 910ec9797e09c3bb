"""Contract of searches: inputs, results, continuation."""
