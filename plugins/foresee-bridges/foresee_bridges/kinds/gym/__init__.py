"""A policy for Gymnasium: the files of `foresee init --driver gym`."""
