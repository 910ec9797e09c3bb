"""Catalogues of standard scenario files, made from recordings."""
