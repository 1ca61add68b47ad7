"""What the pictures of an observation hold (docs/rasters.md), and filling shapes; `simulate.rasters` draws them."""
