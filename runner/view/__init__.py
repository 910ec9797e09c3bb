"""Pages and pictures of runs: replays, reports, rehearsals, assessments.

Modules:

- `assessment`: the table of an assessment: each run of a batch held against a protocol
- `explore`: a scenario point by point: ranges of its parameters, films, borders of failure
- `gym`: the ego driven from outside: an environment for learners
- `page`: HTML pages made of the files beside this module: one file each
- `rehearsal`: dry runs, which load and compile everything and bring it to time 0
- `replay`: runs to look at: pages that play them in a browser, reports of batches, pictures
- `report`: batches as pages: verdicts, distributions of measures, dependence on parameters
- `xosc_replay`: the command `xosc-replay`

Example::

    runner.run("mine.xosc").replay("page.html")
"""
