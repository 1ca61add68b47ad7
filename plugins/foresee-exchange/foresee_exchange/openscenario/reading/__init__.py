"""Import of OpenSCENARIO XML as scenarios of the language."""
