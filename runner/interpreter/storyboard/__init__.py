"""The storyboard at run time: its elements with their states, and the triggers that start and stop them."""
