"""SelfOracle (Stocco et al., ICSE 2020): it finds moments whose front-camera pictures an autoencoder cannot
reconstruct.
"""
