"""A calibration or a discovery from its inputs to the written folder.

Begin with `calibrate`; `discover` is the same with the story of the missing effects.
"""
