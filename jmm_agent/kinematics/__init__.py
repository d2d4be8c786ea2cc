"""Forward and inverse kinematics of the nominal model."""
