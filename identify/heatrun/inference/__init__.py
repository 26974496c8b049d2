"""From reduced records to a fitted model: parameters, noise, fit, posterior, predictions."""
