"""The ego driven from outside: an environment for learners, and a bridge for other processes."""
