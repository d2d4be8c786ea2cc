"""Errors of estimated sizes of hidden effects of known structure, beside their lower bound."""
