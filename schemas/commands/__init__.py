"""What all commands share: their options, and the files that their arguments mean."""
