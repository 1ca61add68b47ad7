"""What formats share (protocol, report, a first scenario on a network), and street sketches."""
