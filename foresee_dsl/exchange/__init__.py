"""Parts that all import and export formats share (protocol, report, a first scenario on a network), and street
sketches."""
