"""ASAM OpenSCENARIO XML: import and export."""
