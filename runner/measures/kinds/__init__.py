"""The criticality measures of a run, a file for each family; `runner.measures.measure` has their base class."""
