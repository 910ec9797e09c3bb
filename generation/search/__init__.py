"""What every search is given, what it leaves, and how it goes on."""
