"""What actions, conditions and positions offer a run, and what a run offers them."""
