"""Learnability: errors that the map reaches from different data, and their lower bound."""
