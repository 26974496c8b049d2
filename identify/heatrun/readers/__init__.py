"""From a file to a record: one reader for each format, columns, clocks, several loggers.

Begin with `read.read_record`. `channel_map` finds the column of each channel, `clock` and `dates`
read times, `joined` puts the files of one test together, `following` reads a file that grows.
"""
