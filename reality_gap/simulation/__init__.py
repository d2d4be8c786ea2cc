"""Simulation of hypotheses: the study's model with candidates in it, replayed along its log."""
