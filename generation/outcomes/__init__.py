"""What episodes do: runs, rewards, systems that fail."""
