"""What a loop has done so far: its stages, what each has found, and how that is kept in its output folder."""
