"""Inverse kinematics of arms and legs, hand shapes, and the room that the body fills."""

__all__: list[str] = []
