"""Networks and maps that were made elsewhere, prepared for SUMO."""
