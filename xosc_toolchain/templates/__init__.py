"""Files that `xosc new plugin` copies; `acme` in them stands for the name of the package."""
