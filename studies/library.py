"""Write the library's files."""

from generation.space.logical.library import write

if __name__ == "__main__":
    print(*write(), sep="\n")
