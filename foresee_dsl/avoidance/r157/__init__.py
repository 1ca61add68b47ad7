"""Models UN Regulation 157's careful driver.

It perceives a risk (`risk`) and brakes along the recorded path (`replay`).
"""
