"""Ways of writing scenarios that differ from the standard's, worked out into what the standard would say."""
