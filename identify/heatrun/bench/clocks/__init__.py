"""Times: clocks and dates as files write them, and two loggers' clocks against each other."""
