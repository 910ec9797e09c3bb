"""TRFE: features, votes, screening, the buffer, and discovery of new classes."""
