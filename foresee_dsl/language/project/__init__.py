"""Files joined to test cases: addresses, catalogues, extension, expansion, parameters."""
