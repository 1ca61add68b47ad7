"""The conformance suite: checks from outside whether a driver keeps the rules of the driver protocol."""
