"""Which settings of smoothing explain best what was not shown to it, and what other ways of
smoothing do."""
