"""Many runs: jobs, processes, clusters, and the journal of finished ones.

Modules:

- `arrays`: parameter sets of one scenario played at once, where all its elements can
- `batch`: many runs: every parameter set of every file, in one process or several
- `inputs`: all that decides what a run gives, by content
- `jobs`: jobs of a batch: their creation from files, and their outcomes
- `journal`: journal of a batch in its output folder: finished runs
- `options`: command-line options of runs besides their settings: values of parameters
- `outputs`: results of runs: folder, tables, report, picture, terminal
- `pool`: jobs in worker processes that are replaced when they die

Example::

    xosc-run variation.xosc --jobs 4 --out results
"""
