"""Data that pages, pictures and animations of runs are drawn from."""
