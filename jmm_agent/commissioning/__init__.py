"""Commissioning: each muscle is pulled a little, and what responds is compared with the model."""
