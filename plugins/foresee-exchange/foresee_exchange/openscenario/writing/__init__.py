"""Export of test cases as OpenSCENARIO XML."""
