"""Choice of the settings of smoothing by held-out rows, and comparison with other methods."""
