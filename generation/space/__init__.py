"""The space that is searched: parameters of a logical scenario and how likely their values are."""
