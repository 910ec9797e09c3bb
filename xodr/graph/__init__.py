"""How roads and lanes hang together: links, ways, routes, travel along them."""
