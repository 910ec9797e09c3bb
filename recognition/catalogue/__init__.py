"""Catalogues of standard scenario files, made from recordings: roads, scenarios, the OpenSCENARIO catalogues that they use, tags."""
