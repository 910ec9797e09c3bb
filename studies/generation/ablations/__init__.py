"""Methods without a part of themselves."""
