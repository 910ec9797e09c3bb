"""How participants move: along lanes, paths and routes, within their dynamics."""
