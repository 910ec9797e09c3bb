"""How many distinct, foreseeable and preventable failures a method finds, and what the twin is worth."""
