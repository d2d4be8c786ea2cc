"""A study: model and measurements, and what of the model can be measured."""
