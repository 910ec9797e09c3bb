"""The criticality measures of a run, a file for each family; `runner.judging.measures.measure` has
their base class."""
