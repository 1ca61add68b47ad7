"""SelfOracle (Stocco et al., ICSE 2020): moments at which the front camera shows what an autoencoder cannot redraw."""
