"""A thermal network with effects, parameters, priors, noise: what a calibration puts to a record.

Begin with `model.Model`. `network_form` and `network_text` are the network and its text,
`model_parameters` what stands in it with its prior, `noise` and `discrepancy` what the readings
scatter by, `problem.Problem` all of it with the tests.
"""
