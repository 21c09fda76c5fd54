"""What plays trained systems without torch: bundles, engines, models."""
