"""The agent: learns the joint-muscle mapping of a tendon-driven robot and moves it.

Importing the package imports nothing heavy; take what is needed from its modules.
"""
