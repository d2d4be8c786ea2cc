"""Inference: noise model, evidence, fits of candidates, search for causes and verdict."""
