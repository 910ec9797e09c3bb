"""The interpreter: compiles a scenario, runs its storyboard, says how it ended."""
