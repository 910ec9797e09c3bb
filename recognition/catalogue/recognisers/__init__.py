"""What is recognised in recordings: moments labelled by rules or by a model, joined into findings."""
