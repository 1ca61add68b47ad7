"""UN Regulation 157's careful driver: it perceives a risk (`risk`), and brakes along the recorded path (`replay`)."""
