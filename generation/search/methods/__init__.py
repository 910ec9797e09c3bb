"""The search methods that `xosc-generate` offers, one module each: MCSG in two forms, quality-diversity, and three that need no
training and no other library.

`random` says what the whole box holds, `kde` how often traffic like the recorded one fails, `conscend` what happens in exactly
the recorded manoeuvres.
"""
