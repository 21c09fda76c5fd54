"""The face: lips, visemes, blinks, expressions, and how they are composed."""

__all__: list[str] = []
