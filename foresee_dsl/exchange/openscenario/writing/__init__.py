"""Test cases to OpenSCENARIO XML."""
