"""Training of SelfOracle's autoencoders (docs/selforacle.md)."""
