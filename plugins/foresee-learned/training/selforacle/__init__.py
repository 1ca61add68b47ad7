"""Training of SelfOracle's autoencoders (docs/background/selforacle.md)."""
