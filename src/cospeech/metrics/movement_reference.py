"""How two people move while they speak: the ranges that statistics of `cospeech.metrics.movement` are compared with.

The mean and the range over 13 windows of 30 s, measured on 413 s of motion capture of two speakers (ZeroEGGS and BEAT2), see
benchmarks/README.md. They can reject motion that is grossly wrong. They are the ranges of two people, not of all people.
"""

from typing import NamedTuple

__all__ = ["REFERENCE", "ReferenceRow"]


class ReferenceRow(NamedTuple):
    """Mean and range (lowest and highest of 13 windows of 30 s) of one statistic."""

    mean: float
    low: float
    high: float

    def holds(self, value: float) -> bool:
        """Whether ``value`` lies in the range, bounds included; NaN does not.

        >>> ReferenceRow(0.29, 0.043, 0.48).holds(0.3)
        True
        """
        return self.low <= value <= self.high

    def distance(self, value: float) -> float:
        """How far ``value`` is from the mean: 0 at the mean, 1 at the end of the range on its side; NaN stays NaN.

        >>> ReferenceRow(0.29, 0.043, 0.48).distance(0.385)
        0.5
        """
        side = self.high - self.mean if value > self.mean else self.mean - self.low
        return round(abs(value - self.mean) / side, 9) if side > 0 else float(value != self.mean)


REFERENCE: dict[str, ReferenceRow] = {
    name: ReferenceRow(*numbers)
    for name, *numbers in [
        ("wrist speed 10 %, m/s", 0.059, 0.0053, 0.14),
        ("wrist speed 25 %, m/s", 0.12, 0.011, 0.26),
        ("wrist speed 50 %, m/s", 0.29, 0.043, 0.48),
        ("wrist speed 75 %, m/s", 0.60, 0.16, 0.95),
        ("wrist speed 90 %, m/s", 0.98, 0.36, 1.53),
        ("wrist speed 99 %, m/s", 1.80, 0.81, 2.79),
        ("left 50 %", 0.29, 0.039, 0.51),
        ("left 90 %", 0.95, 0.39, 1.34),
        ("left 99 %", 1.73, 0.82, 2.34),
        ("right 50 %", 0.28, 0.045, 0.45),
        ("right 90 %", 1.01, 0.35, 1.76),
        ("right 99 %", 1.84, 0.78, 2.85),
        ("speed SD / mean", 0.97, 0.75, 1.45),
        ("acceleration 50 %, m/s²", 2.01, 0.30, 3.98),
        ("acceleration 90 %, m/s²", 6.49, 3.21, 9.95),
        ("acceleration 99 %, m/s²", 12.2, 7.38, 15.2),
        ("jerk 50 %, m/s³", 20.5, 3.69, 42.5),
        ("jerk 90 %, m/s³", 74.5, 39.6, 127),
        ("jerk 99 %, m/s³", 174, 111, 231),
        ("log dimensionless jerk per stroke", -5.01, -5.29, -4.74),
        ("left at rest (< 0.1 m/s)", 0.22, 0.063, 0.64),
        ("right at rest", 0.23, 0.049, 0.67),
        ("both at rest", 0.15, 0.016, 0.61),
        ("strokes per min, left", 54.9, 19.8, 75.7),
        ("strokes per min, right", 55.8, 15.8, 97.6),
        ("strokes per min and hand", 55.3, 17.8, 80.3),
        ("median stroke peak, m/s", 0.98, 0.76, 1.62),
        ("stroke duration 10 %, s", 0.29, 0.17, 0.43),
        ("stroke duration 50 %, s", 0.46, 0.27, 0.57),
        ("stroke duration 90 %, s", 0.73, 0.53, 0.93),
        ("left–right speed correlation", 0.67, 0.37, 0.93),
        ("right share of speed", 0.50, 0.47, 0.55),
        ("share of time: wrist below hip", 0.16, 0, 0.46),
        ("share of time: hip to chest", 0.61, 0.40, 0.96),
        ("share of time: chest to shoulder", 0.19, 0.029, 0.46),
        ("share of time: above shoulder", 0.043, 0, 0.27),
        ("height over shoulders / arm, 5 %", -0.95, -1.00, -0.88),
        ("height over shoulders / arm, 50 %", -0.65, -0.91, -0.28),
        ("height over shoulders / arm, 95 %", -0.14, -0.40, 0.24),
        ("outward of own shoulder / arm, 5 %", -0.045, -0.16, 0.16),
        ("outward of own shoulder / arm, 50 %", 0.19, 0.13, 0.25),
        ("outward of own shoulder / arm, 95 %", 0.48, 0.29, 0.59),
        ("forward of shoulders / arm, 5 %", -0.0028, -0.19, 0.20),
        ("forward of shoulders / arm, 50 %", 0.31, 0.17, 0.46),
        ("forward of shoulders / arm, 95 %", 0.61, 0.41, 0.82),
        ("SD of height / arm", 0.27, 0.18, 0.39),
        ("SD of lateral / arm", 0.16, 0.049, 0.22),
        ("SD of forward / arm", 0.19, 0.085, 0.27),
        ("share beyond the midline", 0.0081, 0, 0.029),
        ("elbow flexion left 5 %, deg", 36.4, 22.0, 54.3),
        ("elbow flexion left 50 %, deg", 62.4, 40.2, 97.3),
        ("elbow flexion left 95 %, deg", 113, 101, 122),
        ("elbow flexion right 5 %, deg", 25.7, 16.4, 53.6),
        ("elbow flexion right 50 %, deg", 59.9, 23.0, 93.3),
        ("elbow flexion right 95 %, deg", 110, 86.0, 128),
        ("slope of log position power, 0.1–10 Hz", -4.87, -5.75, -4.23),
        ("position power above 4 Hz", 0.0001, 0, 0.0002),
        ("velocity power above 4 Hz", 0.0080, 0.0010, 0.023),
        ("velocity power in the strongest 0.3 Hz", 0.24, 0.11, 0.37),
        ("torso pitch SD, deg", 3.27, 0.54, 5.60),
        ("torso roll SD, deg", 2.22, 0.36, 3.90),
        ("torso yaw SD, deg", 4.36, 2.11, 7.99),
        ("torso pitch 5–95 %, deg", 10.5, 1.78, 16.5),
        ("torso roll 5–95 %, deg", 7.52, 1.06, 13.4),
        ("torso yaw 5–95 %, deg", 14.5, 6.16, 26.8),
        ("sway peak of f·P(f), Hz", 0.38, 0.15, 0.65),
        ("torso speed median, deg/s", 10.8, 2.65, 18.6),
        ("head pitch SD, deg", 5.82, 4.22, 9.59),
        ("head yaw SD, deg", 9.57, 7.36, 10.7),
        ("head roll SD, deg", 5.95, 3.69, 6.98),
        ("head speed 50 %, deg/s", 21.7, 19.3, 27.1),
        ("head speed 90 %, deg/s", 49.4, 39.8, 62.8),
        ("head speed 99 %, deg/s", 92.3, 56.7, 144),
        ("nods per min", 37.8, 27.9, 51.0),
        ("finger joint 5–95 %, median joint, deg", 48.0, 29.1, 76.4),
        ("finger joint 5–95 %, largest, deg", 92.3, 57.3, 120),
        ("finger speed 50 %, deg/s", 15.6, 4.57, 37.5),
        ("finger speed 90 %, deg/s", 65.9, 28.7, 107),
        ("finger speed 99 %, deg/s", 199, 75.4, 363),
        ("hip path (1 Hz), m/min", 6.02, 0.58, 11.1),
        ("hip SD, m", 0.15, 0.0068, 0.33),
        ("foot speed 50 %, m/s", 0.030, 0.0037, 0.063),
        ("foot speed 90 %, m/s", 0.31, 0.028, 0.62),
        ("foot speed 99 %, m/s", 0.90, 0.15, 1.33),
        ("foot moving (> 0.1 m/s)", 0.21, 0.022, 0.33),
        ("steps per min (peaks > 0.3 m/s)", 29.5, 1.74, 49.1),
    ]
}
"""Statistic → (mean, low, high). A number in a name is a percentile; *arm* is the length from shoulder to wrist."""
