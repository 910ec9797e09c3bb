"""Roads in other formats, read and written."""
