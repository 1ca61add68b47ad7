"""OpenSCENARIO XML to scenarios of the language."""
