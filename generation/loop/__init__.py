"""The closed loop: recordings are recognised, varied into edge cases, checked, run and shown;
failures feed the next search.

Modules:

- `demo`: recordings and scenarios of `make demo`
- `findings`: findings of the stages of a loop, and their lines of text
- `inputs`: inputs of the loop: recordings and scenarios of a folder
- `loop`: the loop itself: stage after stage, each done once, and a page of all at the end
- `page`: the page of a loop: what was recognised, generated, checked and run
- `runs`: runs of a loop: edge cases driven again as files
- `searches`: searches of a loop, and the fate of the failures that an earlier loop found
- `xosc_loop`: the command `xosc-loop`

Example::

    xosc-loop recordings --out loop
"""
