"""Motion of entities along lanes, paths and routes within their dynamics."""
