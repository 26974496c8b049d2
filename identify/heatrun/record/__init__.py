"""A test as numbers: the record, its channels and units, the machine, blocks of equal length.

Begin with `record`: a `Record` holds the channels of one test in canonical units, a `Finding` what
is wrong with it. `channels` names the channels, `units` converts them, `motor` is the machine that
was tested, `reduction` averages a record to the `Blocks` that a fit sees.
"""
