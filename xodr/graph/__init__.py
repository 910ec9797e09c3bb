"""Connections of roads and lanes: links, ways, routes, travel along them."""
