"""Discovery of new classes: the buffer, sifting, clustering and the promotion of clusters."""
