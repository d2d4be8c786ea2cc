"""Hours of continuous learning."""
