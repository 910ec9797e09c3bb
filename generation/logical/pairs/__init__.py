"""Two adversaries around the ego: who they are, their scenarios, and what recorded units they are."""
