"""The kernels of the driver `pdm`, from tracks to the chosen proposal; `idm` and `frenetix` use them too."""
