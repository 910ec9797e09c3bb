"""Report of a search as one page, with its differences from a search of another version of the
system.

Modules:

- `assurance`: what a search tested, what failures depend on, what it can and cannot say
- `counterexamples`: failures as a tester reads them: measures, counterexamples
- `options`: the options that several commands of generation take besides whole settings
- `page`: styles and scripts of its page
- `regression`: fates of the failures of another version of the system, replayed on this one
- `report`: summary of a report in sentences: failures, their frequency, their severity

Example::

    xosc-generate logical.xosc --out edges  # edges/index.html
"""
