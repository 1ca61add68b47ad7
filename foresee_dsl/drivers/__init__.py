"""The software under test: the driver protocol, the bundled drivers, and the registry of installed drivers."""
