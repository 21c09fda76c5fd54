"""Plays trained models without PyTorch: bundles, engines, decoders, sessions."""
