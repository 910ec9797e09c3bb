"""Contract of searches: inputs, results, continuation.

Modules:

- `environment`: the Markov decision process of MCSG as a Gymnasium environment
- `gate`: unguided runs: the gate that a density has to pass before it judges what is
- `methods`: search methods by name: a function of `problem`, `budget`, `seed` each
- `outcomes`: outcomes of runs at points of a parameter space, and the judges of failures
- `plays`: plays of points in arrays, without a simulator
- `problem`: search problem: its reward, calls of the simulator within a budget
- `settings`: settings of searches and of the loop
- `variations`: variation files: reading what varies, and writing edge cases

Example::

    xosc-generate logical.xosc --out edges --method mcsg
"""
