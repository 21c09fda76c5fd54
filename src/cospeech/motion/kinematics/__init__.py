"""Inverse kinematics of arms and legs, hand shapes, and the volume of the body."""

__all__: list[str] = []
