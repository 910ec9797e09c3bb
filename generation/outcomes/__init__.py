"""Outcomes of episodes: runs, rewards, failing systems."""
