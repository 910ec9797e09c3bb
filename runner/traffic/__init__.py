"""Traffic that the scenario asks for without naming it."""
