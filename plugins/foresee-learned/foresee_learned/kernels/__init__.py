"""Inner loops of the learned drivers and of the pictures as machine code (`foresee_dsl.kernels.compiling`)."""
